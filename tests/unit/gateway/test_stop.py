"""The stop: every drive at once, without a lease, answered per drive, and held."""

from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path

import pytest

from drivers.component import Kind
from drivers.joint.quick_stop import StopOutcome
from gateway.modules.stop.drive import is_enabled
from tests.unit.gateway.harness import DISABLED, ENABLED, ROBOT, Bench, Client, config, serving, until


def test_a_stop_needs_no_lease_and_answers_per_drive(connect: Callable[[], Client], bench: Bench) -> None:
    writer, other = connect(), connect()
    writer.call("control.acquire", ttl_s=60)
    answer = other.call("robot.stop", reason="the patient stumbles")
    assert answer == {
        "drives": {"left_knee": "confirmed", "right_knee": "confirmed"},
        "held": True,
        "controllers": {},
        "fallbacks": {},
        "problem": None,
    }
    assert (bench.left.stops, bench.right.stops) == (1, 1)
    stop = other.call("robot.describe")["stop"]
    assert (stop["held"], stop["reason"]) == (True, "the patient stumbles")
    assert stop["since_ns"] > 0


def test_only_what_is_confirmed_counts_as_stopped(client: Client, bench: Bench) -> None:
    bench.left.stopping = StopOutcome.UNCONFIRMED
    bench.right.stopping = StopOutcome.UNREACHABLE
    drives = client.call("robot.stop", reason="")["drives"]
    assert drives == {"left_knee": "unconfirmed", "right_knee": "unreachable"}


def test_a_drive_that_could_not_be_built_is_unreachable(client: Client, bench: Bench) -> None:
    bench.absent["left_knee"] = (Kind.JOINT, "its EDS is broken")
    assert client.call("robot.stop")["drives"] == {"right_knee": "confirmed", "left_knee": "unreachable"}


def test_a_driver_that_fails_does_not_keep_the_others_from_stopping(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*, wake: bool = True) -> Future[StopOutcome]:
        raise RuntimeError("driver bug")

    monkeypatch.setattr(bench.left, "quick_stop", fail)
    assert client.call("robot.stop")["drives"] == {"left_knee": "unreachable", "right_knee": "confirmed"}


def test_a_stop_is_answered_although_a_drive_never_is(bench: Bench, tmp_path: Path) -> None:
    bench.left.hanging = Future()
    with serving(config(tmp_path, ROBOT + "[stop]\ntimeout_s = 0.1\n")) as address, Client(address) as client:
        answer = client.call("robot.stop")
    assert answer["drives"] == {"left_knee": "unconfirmed", "right_knee": "confirmed"}


@pytest.mark.parametrize(
    "line",
    [
        b'{"jsonrpc":"2.0","id":1,"method":"robot.stop"}\n',
        b'{"jsonrpc":"2.0","id":1,"method":"robot.stop","params":{}}\n',
        b'{"jsonrpc":"2.0","id":1,"method":"robot.stop","params":{"reason":5,"by":"me"}}\n',
    ],
)
def test_a_stop_is_not_refused_for_its_form(client: Client, bench: Bench, line: bytes) -> None:
    client.send(line)
    assert client.answer(1)["drives"]["left_knee"] == "confirmed"


def test_a_drive_enabled_again_is_stopped_again_and_it_is_said(client: Client, bench: Bench) -> None:
    client.call("robot.stop")
    for _ in range(3):
        bench.left.set_state(ENABLED)
        until(lambda: not is_enabled(bench.left.latest.read(1, 0)[0] or 0), "stopped again")
    assert bench.right.stops == 1
    assert client.call("robot.describe")["stop"]["stopped_again"] == {"left_knee": 3, "right_knee": 0}


def test_a_drive_that_nobody_can_see_is_asked_again(client: Client, bench: Bench) -> None:
    bench.left.set_state(DISABLED)
    client.call("robot.stop")
    bench.left.stopping = StopOutcome.UNREACHABLE
    bench.left.latest.clear()
    until(lambda: bench.left.stops >= 3, "asked again and again")


def test_a_drive_that_stays_stopped_is_left_alone(client: Client, bench: Bench) -> None:
    client.call("robot.stop")
    until(lambda: client.call("clock.read")["monotonic_ns"] > _after(client, 0.8), "the watch has looked")
    assert (bench.left.stops, bench.right.stops) == (1, 1)


def _after(client: Client, seconds: float) -> int:
    since_ns: int = client.call("robot.describe")["stop"]["since_ns"]
    return since_ns + round(seconds * 1e9)


def test_a_held_stop_outlives_its_clients(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path)) as address:
        with Client(address) as client:
            client.call("robot.stop", reason="test")
        with Client(address) as client:
            client.call("clock.read")
            until(lambda: client.call("clock.read")["monotonic_ns"] > _after(client, 0.3), "linger_s is over")
        assert bench.left.stopped == 0
        bench.left.set_state(ENABLED)
        until(lambda: bench.left.stops == 2, "stopped again without any client")
        with Client(address) as client:
            assert client.call("robot.describe")["stop"]["held"] is True
    assert bench.left.stopped == 1


def test_a_stop_is_done_although_its_client_vanishes(connect: Callable[[], Client], bench: Bench) -> None:
    client = connect()
    client.request("robot.stop", reason="and gone")
    client.close()
    until(lambda: (bench.left.stops, bench.right.stops) == (1, 1), "stopped")


@pytest.mark.parametrize(
    ("statusword", "enabled"),
    [
        (0x27, True),
        (0x1237, True),
        (0x8637, True),
        (0x07, False),
        (0x40, False),
        (0x23, False),
        (0x08, False),
    ],
)
def test_operation_enabled_is_read_from_the_statusword(statusword: int, enabled: bool) -> None:
    assert is_enabled(statusword) is enabled
