"""What the guard tells others of its rules, which stop or hold the parameters, and what it asks them."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from drivers.component import ComponentKind
from gateway.config.guard import GuardSettings
from gateway.config.guard_rules import DriftRule, GuardRule, RangeRule
from gateway.guard.module import GuardModule
from gateway.modules.component.assembly import Robot
from tests.unit.guard.bench import Bench


class Loop:
    """Does what is posted at once, and nothing later."""

    def post(self, action: Callable[[], object]) -> None:
        action()

    def call_later(self, _delay_s: float, _action: Callable[[], object]) -> None:
        """Nobody waits for it."""


def limit(*actions: str, **more: Any) -> GuardRule:
    table = {
        "watch": "joint_limit",
        "max": 2.0,
        "clear_s": 0.05,
        "actions": actions,
        "on": ["*_knee"],
        **more,
    }
    return msgspec.convert(table, RangeRule)


@contextmanager
def guarding(robot: Robot, rules: Mapping[str, GuardRule], held: bool = False) -> Iterator[GuardModule]:
    journal = SimpleNamespace(append=lambda *_args, **_more: None)
    control = SimpleNamespace(
        drives={}, journal=journal, authority=SimpleNamespace(held=held), trip=lambda _who, _why: None
    )
    needs = {"component": SimpleNamespace(robot=robot, sources=[]), "control": control}
    config = SimpleNamespace(guard=GuardSettings(rule=dict(rules)))
    context: Any = SimpleNamespace(loop=Loop(), needs=needs, config=config)
    module = GuardModule(context)
    assert (module.standing, module.frozen) == ({}, None), "nothing runs yet"
    module.start()
    yield module
    module.stop()


def test_a_rule_stops_and_holds_as_long_as_it_is_tripped(bench: Bench) -> None:
    rules = {
        "stops": limit("quick_stop", "alarm"),
        "holds": limit("hold_parameters"),
        "both": limit("quick_stop", "hold_parameters", max=3.0),
        "tells": limit("alarm", max=1.0),
    }
    why = "left_knee.position: 2.5 rad, above 2 rad"
    with guarding(Robot({}, {"left_knee": bench.knee}, {}, {}), rules) as guard:
        bench.knee.give("position", 1.5)
        assert (guard.standing, guard.frozen) == ({}, None)
        bench.knee.give("position", 2.5)
        assert guard.standing == {"stops": why}
        assert guard.frozen == f"the guard's rule holds the parameters: holds ({why})"
        bench.knee.give("position", 3.5)
        assert guard.standing == {"stops": why, "both": "left_knee.position: 3.5 rad, above 3 rad"}
        assert guard.frozen is not None
        assert f"holds ({why}), both (left_knee.position: 3.5 rad" in guard.frozen
        now_ns = time.monotonic_ns()
        for later_ns in (0, 50_000_000):
            bench.knee.give("position", 0.0, now_ns + later_ns)
        assert guard.standing == {}
        assert guard.frozen is None


def test_where_it_cannot_see_a_rule_stops_and_holds_only_if_it_acts_then() -> None:
    rules = {
        "acts": limit("quick_stop", "hold_parameters", blind="act"),
        "tells": limit("quick_stop", "hold_parameters"),
    }
    robot = Robot({}, {}, {}, {"left_knee": (ComponentKind.JOINT, "its EDS is broken")})
    with guarding(robot, rules) as guard:
        why = "left_knee: is not there: its EDS is broken"
        assert guard.standing == {"acts": why}
        assert guard.frozen == f"the guard's rule holds the parameters: acts ({why})"


@pytest.mark.parametrize("held", [True, False])
def test_what_drifts_while_it_is_held_is_judged_where_a_stop_is_held(bench: Bench, held: bool) -> None:
    table = {"watch": "drift_while_held", "above": 0.1, "settle_s": 0.0, "actions": ["quick_stop"]}
    rules = {"drift": msgspec.convert(table, DriftRule)}
    with guarding(Robot({}, {"left_knee": bench.knee}, {}, {}), rules, held) as guard:
        for position in (1.0, 1.2):
            bench.knee.give("position", position)
        assert bool(guard.standing) is held
