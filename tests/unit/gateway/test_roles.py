"""What each role may do: every method, asked by every role, in every state of lease, stop and trial."""

import itertools
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from gateway.access import roles
from gateway.access.identity import ANYBODY, Identity
from gateway.wire.methods import METHODS
from gateway.wire.role import Role
from tests.unit.gateway.harness import DISABLED, Answered, Bench, config, serving
from tests.unit.gateway.keyed import KeyedClient, keyed
from tests.unit.gateway.test_methods import EXAMPLES
from tests.unit.gateway.tuned import drives

VIEWERS = {
    "hello", "clock.read", "robot.describe", "gateway.cost", "resource.snapshot", "resource.overruns",
    "component.snapshot", "bus.snapshot", "status.snapshot", "stream.start", "stream.stop", "journal.tail",
    "journal.head",
    "parameter.list", "parameter.read", "object.list", "object.read", "robot.stop",
}  # fmt: skip
OPERATORS = VIEWERS | {
    "control.acquire", "control.release", "parameter.write", "parameter.confirm", "parameter.revert",
}  # fmt: skip
MAINTAINERS = OPERATORS | {"parameter.store", "parameter.restore", "robot.reset", "robot.enable"}
MAY = {Role.VIEWER: VIEWERS, Role.OPERATOR: OPERATORS, Role.MAINTAINER: MAINTAINERS}
BEYOND: dict[str, dict[str, Any]] = {
    "resource.snapshot": {"include": ["cmdline"]},
    "control.acquire": {"ttl_s": 10, "take_over": True},
}
LOOKS = VIEWERS - {"robot.stop"}  # what changes nothing of the state that it is asked in
# A trial without a lease there is none: it ends with it.
STATES = [
    one
    for one in itertools.product((None, "asker", "other"), (False, True), (False, True))
    if one[0] or not one[2]
]
STEP = (0x2001, 0)


def test_the_table_is_the_one_that_was_decided() -> None:
    assert set(METHODS) == MAINTAINERS
    for role, allowed in MAY.items():
        assert set(METHODS) - set(roles.refused(Identity(role, "anna"))) == allowed


def test_a_refusal_says_who_one_is_and_whom_to_ask() -> None:
    refused = roles.refused(Identity(Role.VIEWER, "anna"))
    said = "anna is a viewer on this robot, and parameter.write is for an operator; ask one"
    assert refused["parameter.write"] == said


def test_without_keys_the_loopback_may_everything() -> None:
    assert roles.refused(ANYBODY) == {}


@pytest.mark.parametrize(("word", "method"), [("reset", "robot.reset"), ("enable", "robot.enable")])
def test_operators_may_what_the_robot_grants_them_and_viewers_not(word: str, method: str) -> None:
    assert method not in roles.refused(Identity(Role.OPERATOR, "anna", granted=(word,)))
    assert method in roles.refused(Identity(Role.VIEWER, "anna", granted=(word,)))
    assert len(roles.refused(Identity(Role.OPERATOR, "anna", granted=(word,)))) == 3


class Arranged:
    """A robot with keys, three who have one each, and a maintainer who arranges what it is in."""

    def __init__(self, bench: Bench, connect: Callable[[str], KeyedClient]) -> None:
        self.bench = bench
        self.people = {role: connect(role.value) for role in Role}
        self.arranger = connect("arranger")
        self._write: int | None = None

    def arrange(self, asker: Role, lease: str | None, held: bool, trial: bool) -> None:
        """Lease: nobody's, the asker's or another's; whose may not have one leaves it to the arranger."""
        arranger = self.arranger
        arranger.call("control.acquire", ttl_s=60, take_over=True)  # ends whatever was on trial
        arranger.call("robot.reset")
        arranger.call("control.release")
        drives(self.bench, DISABLED)
        holder = self.people[asker] if lease == "asker" and asker is not Role.VIEWER else arranger
        if lease is not None:
            holder.call("control.acquire", ttl_s=60)
        if trial:
            wanted = 0.42 if self._step() != 420 else 0.44
            self._write = holder.call("parameter.write", changes={"gait.step_length": wanted}, trial_s=60)[
                "write"
            ]
        if held:
            arranger.call("robot.stop", reason="arranged")

    def state(self) -> Any:
        described = self.arranger.call("robot.describe")
        trials = [(one["write"], one["values"]) for one in described["trials"]]
        return described["stop"]["held"], trials, self._step(), self.bench.left.resets

    def _step(self) -> int:
        return int.from_bytes(self.bench.gait.node.objects[STEP], "little")


@pytest.fixture
def arranged(bench: Bench, tmp_path: Path) -> Iterator[Arranged]:
    keyed(tmp_path, {**{role.value: role for role in Role}, "arranger": Role.MAINTAINER})
    drives(bench, DISABLED)
    with serving(config(tmp_path)) as address, ExitStack() as clients:
        yield Arranged(bench, lambda name: clients.enter_context(KeyedClient(address, name)))


def asked(client: KeyedClient, name: str, params: dict[str, Any]) -> str | None:
    """What is answered: the words of a refusal for one's role, or `None`."""
    try:
        client.call(name, **params)
    except Answered as error:
        return str(error) if error.kind == "not_allowed" and "on this robot" in str(error) else None
    return None


@pytest.mark.parametrize(("lease", "held", "trial"), STATES)
def test_whatever_the_robot_is_in_each_role_may_what_it_may_and_nothing_else(
    arranged: Arranged, lease: str | None, held: bool, trial: bool
) -> None:
    for role, client in arranged.people.items():
        arranged.arrange(role, lease, held, trial)
        before = arranged.state()
        for name in sorted(set(METHODS) - MAY[role]):
            assert asked(client, name, EXAMPLES.get(name, {})), (role, name)
        for name, params in BEYOND.items():
            if role is not Role.MAINTAINER:
                assert asked(client, name, params), (role, name)
        assert arranged.state() == before, "what is refused has changed nothing"
        for name in sorted(MAY[role], key=lambda name: (name not in LOOKS, name)):
            if name not in LOOKS:
                arranged.arrange(role, lease, held, trial)
            assert asked(client, name, EXAMPLES.get(name, {})) is None, (role, name)


def test_a_maintainer_takes_a_lease_over_and_the_journal_says_from_whom(arranged: Arranged) -> None:
    operator, maintainer = arranged.people[Role.OPERATOR], arranged.people[Role.MAINTAINER]
    operator.call("control.acquire", ttl_s=60)
    operator.call("parameter.write", changes={"gait.step_length": 0.42}, trial_s=60)
    assert maintainer.refused("control.acquire", ttl_s=60).kind == "lease_held"
    maintainer.call("control.acquire", ttl_s=60, take_over=True)
    assert operator.refused("parameter.write", changes={"gait.step_length": 0.43}).kind == "no_lease"
    entries = maintainer.call("journal.tail", n=50)["entries"]
    over = [one["who"] for one in entries if one["what"].startswith("lease taken over by maintainer")]
    assert len(over) == 1
    assert over[0].startswith("operator")
