"""A robot with keys: who is let in, as whom, and that nobody else is told anything."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.support.waiting import until
from tests.unit.gateway.harness import Bench, config, serving
from tests.unit.gateway.keyed import KeyedClient, keyed, raw, said

Connect = Callable[[str | None], KeyedClient]


@pytest.fixture
def address(bench: Bench, tmp_path: Path) -> Iterator[tuple[str, int]]:
    keyed(tmp_path)
    with serving(config(tmp_path)) as address:
        yield address


@pytest.fixture
def come(address: tuple[str, int]) -> Iterator[Connect]:
    with ExitStack() as clients:
        yield lambda name: clients.enter_context(KeyedClient(address, name))


@pytest.mark.parametrize("name", ["viewer", "operator", "maintainer"])
def test_who_has_a_key_is_who_it_belongs_to_whatever_they_say(come: Connect, name: str) -> None:
    hello = come(name).call("hello", client="maintainer")
    assert (hello["identity"], hello["role"]) == (name, name)


def test_every_role_may_stop(come: Connect) -> None:
    for name in ("viewer", "operator", "maintainer"):
        assert come(name).call("robot.stop", reason="enough")["held"] is True


def test_who_is_unknown_is_not_let_in(come: Connect) -> None:
    with pytest.raises(OSError):
        come("stranger").call("hello", client="stranger")


def test_who_has_no_key_is_not_let_in(come: Connect) -> None:
    with pytest.raises(OSError):
        come(None).call("hello", client="nobody")


def test_no_plaintext_is_answered(address: tuple[str, int]) -> None:
    with raw(address) as bare:
        bare.sendall(b'{"jsonrpc":"2.0","id":1,"method":"robot.stop"}\n')
        assert said(bare) == b""


def test_who_is_revoked_while_connected_is_closed_and_their_trial_taken_back(
    come: Connect, bench: Bench, tmp_path: Path
) -> None:
    operator = come("operator")
    operator.call("control.acquire", ttl_s=60)
    operator.call("parameter.write", changes={"gait.step_length": 0.42}, trial_s=60)
    assert bench.gait.node.objects[0x2001, 0] == (420).to_bytes(2, "little")
    (tmp_path / "clients" / "operator.crt").unlink()
    until(lambda: bench.gait.node.objects[0x2001, 0] == (400).to_bytes(2, "little"), "it is taken back")
    while operator.line() is not None:
        pass
    with pytest.raises(OSError):
        come("operator").call("hello", client="again")
