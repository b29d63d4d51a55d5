"""robot.enable: for a master with the lease, on command, one transition at a time, and never under a stop."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path

import pytest

from drivers.joint.cia402 import DriveState
from drivers.joint.commands import WAY_UP
from drivers.joint.transitions import Led
from gateway.process.futures import done
from tests.support.waiting import until
from tests.unit.gateway.harness import DISABLED, ROBOT, Bench, Client, config, serving

S = DriveState
MASTER = ROBOT.replace("linger_s", 'role = "master"\nlinger_s')
WAY = list(WAY_UP)


@pytest.fixture
def bench(bench: Bench) -> Bench:
    for drive in (bench.left, bench.right):
        drive.set_state(DISABLED)
        drive.led_up[S.SWITCHED_ON] = Led(S.OPERATION_ENABLED, mode=8)
    return bench


@pytest.fixture
def client(bench: Bench, tmp_path: Path) -> Iterator[Client]:
    with serving(config(tmp_path, MASTER)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        yield client


def test_an_observer_never_enables(connect: Callable[[], Client], bench: Bench) -> None:
    client = connect()
    client.call("control.acquire", ttl_s=60)
    refusal = client.refused("robot.enable")
    assert refusal.kind == "not_allowed"
    assert "only the controller that owns the bus may enable drives: start it there" in str(refusal)
    assert bench.left.steps == []


def test_it_needs_the_lease(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path, MASTER)) as address, Client(address) as client:
        assert client.refused("robot.enable").kind == "no_lease"
    assert bench.left.steps == []


def test_a_held_stop_refuses_it_until_the_reset(client: Client, bench: Bench) -> None:
    client.call("robot.stop", reason="look at the cable")
    error = client.refused("robot.enable")
    assert error.kind == "stopped"
    assert "look at the cable" in str(error)
    assert bench.left.steps == []
    client.call("robot.reset")
    assert client.call("robot.enable")["problems"] == {}


def test_all_drives_make_one_transition_before_any_makes_the_next(client: Client, bench: Bench) -> None:
    order: list[tuple[str, DriveState]] = []
    bench.left.on_step = lambda origin: order.append(("left", origin))
    bench.right.on_step = lambda origin: order.append(("right", origin))
    answer = client.call("robot.enable")
    assert order == [(side, origin) for origin in WAY for side in ("left", "right")]
    assert answer == {
        "drives": dict.fromkeys(("left_knee", "right_knee"), "operation enabled"),
        "problems": {},
        "modes": dict.fromkeys(("left_knee", "right_knee"), "cyclic synchronous position"),
    }
    assert [one["what"] for one in client.call("journal.tail", n=2)["entries"]] == ["enabling", "enabled"]


def test_only_what_is_named_is_enabled(client: Client, bench: Bench) -> None:
    assert list(client.call("robot.enable", joints=["left_*"])["drives"]) == ["left_knee"]
    assert bench.right.steps == []
    assert client.refused("robot.enable", joints=["tail"]).kind == "unknown_name"


@pytest.mark.parametrize("origin", WAY)
def test_a_surprise_ends_it_and_stops_what_was_begun(
    client: Client, bench: Bench, origin: DriveState
) -> None:
    bench.left.led_up[origin] = Led(S.FAULT, f"it did not go from {origin.words}")
    answer = client.call("robot.enable")
    assert answer["problems"]["left_knee"].startswith("it did not go from")
    assert answer["problems"]["right_knee"].startswith("another drive was not led there")
    assert (bench.left.stops, bench.right.stops) == (1, 1)
    assert bench.right.steps == WAY[: WAY.index(origin) + 1]
    assert client.call("journal.tail", n=1)["entries"][0]["what"] == "not enabled"


def test_a_drive_that_was_enabled_before_is_not_stopped_for_anothers_sake(
    client: Client, bench: Bench
) -> None:
    bench.right.led_up = dict.fromkeys(WAY, Led(S.OPERATION_ENABLED))
    bench.left.led_up[S.SWITCH_ON_DISABLED] = Led(S.FAULT, "it is in fault")
    assert list(client.call("robot.enable")["problems"]) == ["left_knee"]
    assert (bench.left.stops, bench.right.stops) == (1, 0)


def test_a_stop_between_two_transitions_ends_it(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    second: Future[Led] = Future()
    stops: list[int] = []

    def step_up(origin: DriveState, _wanted: object) -> Future[Led]:
        if origin is not S.READY_TO_SWITCH_ON:
            return done(Led(WAY_UP[origin][1]))
        stops.append(client.request("robot.stop", reason="now"))
        return second

    monkeypatch.setattr(bench.right, "step_up", step_up)
    enabling = client.request("robot.enable")
    until(lambda: stops and bench.left.stops, "the stop was carried out")
    second.set_result(Led(S.SWITCHED_ON))
    answer = client.answer(enabling)
    assert S.SWITCHED_ON not in bench.left.steps
    assert "the stop of" in answer["problems"]["left_knee"]
    assert client.answer(stops[0])["held"] is True


def test_a_lease_that_ends_meanwhile_ends_it(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first: Future[Led] = Future()
    with serving(config(tmp_path, MASTER)) as address, Client(address) as client:
        monkeypatch.setattr(bench.left, "step_up", lambda _origin, _wanted: first)
        client.call("control.acquire", ttl_s=60)
        enabling = client.request("robot.enable")
        until(lambda: bench.right.steps, "it is under way")
        client.call("control.release")
        first.set_result(Led(S.READY_TO_SWITCH_ON))
        problems = client.answer(enabling)["problems"]
        assert problems
        assert all("the lease" in problem for problem in problems.values())
        assert (bench.left.stops, bench.right.stops) == (1, 1)
        assert bench.right.steps == [S.SWITCH_ON_DISABLED]


def test_what_cannot_be_journaled_is_not_enabled(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "records").write_text("this is no folder")
    text = MASTER.replace("linger_s", 'records = "records"\nlinger_s')
    with serving(config(tmp_path, text)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        error = client.refused("robot.enable")
        assert error.kind == "unavailable"
        assert "nothing was enabled" in str(error)
    assert bench.left.steps == []
