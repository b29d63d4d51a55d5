"""robot.reset: needs the lease, leads to switch on disabled, ends the hold only where nothing can move."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path

import pytest

from drivers.component import ComponentKind
from drivers.joint.cia402 import DriveState
from drivers.joint.transitions import Led
from gateway.records.folder import RecordsFolder
from tests.support.waiting import until
from tests.unit.gateway.harness import DISABLED, ENABLED, ROBOT, Bench, Client, config, serving

S = DriveState


@pytest.fixture
def client(bench: Bench, tmp_path: Path) -> Iterator[Client]:
    text = ROBOT.replace("linger_s", 'records = "records"\nlinger_s')
    with serving(config(tmp_path, text)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        client.call("robot.stop", reason="test")
        yield client


@pytest.fixture
def hold(tmp_path: Path) -> Path:
    return RecordsFolder(tmp_path / "records").hold


def test_a_reset_needs_the_lease(connect: Callable[[], Client], bench: Bench) -> None:
    holder, other = connect(), connect()
    holder.call("control.acquire", ttl_s=60)
    assert other.refused("robot.reset").kind == "no_lease"
    assert bench.left.resets == 0


def test_every_drive_at_rest_ends_the_hold_and_its_record(client: Client, bench: Bench, hold: Path) -> None:
    words = "switch on disabled"
    answer = client.call("robot.reset")
    assert answer == {"drives": {"left_knee": words, "right_knee": words}, "problems": {}, "held": False}
    assert not hold.exists()
    assert client.call("robot.describe")["stop"]["held"] is False
    entry = client.call("journal.tail", n=1)["entries"][0]
    assert (entry["what"], entry["held"]) == ("reset", False)
    bench.left.set_state(ENABLED)  # whoever may, may again
    client.call("clock.read")
    assert bench.left.stops == 1


@pytest.mark.parametrize(
    ("led", "held"),
    [
        (Led(S.FAULT, "it stays in fault"), False),  # no current: it cannot move
        (Led(None, "it does not answer"), True),
        (Led(S.OPERATION_ENABLED, "it stays in operation enabled"), True),
        (Led(S.QUICK_STOP_ACTIVE, "it stays in quick stop active"), True),
        (Led(S.SWITCHED_ON, "it stays in switched on"), True),
        (Led(S.READY_TO_SWITCH_ON, "it stays in ready to switch on"), True),
        (Led(S.NOT_READY_TO_SWITCH_ON, "it stays in not ready to switch on"), True),
        (Led(S.FAULT_REACTION_ACTIVE, "it stays in fault reaction active"), True),
    ],
)
def test_one_drive_of_which_it_is_not_known_that_it_has_no_current_keeps_it_held(
    client: Client, bench: Bench, hold: Path, led: Led, held: bool
) -> None:
    bench.left.led = led
    answer = client.call("robot.reset")
    assert answer["problems"] == {"left_knee": led.problem}
    assert answer["drives"]["right_knee"] == "switch on disabled"
    assert answer["held"] is held
    assert hold.exists() is held


def test_a_joint_that_could_not_be_built_keeps_it_held(bench: Bench, tmp_path: Path) -> None:
    bench.absent["left_knee"] = (ComponentKind.JOINT, "its EDS is broken")
    with serving(config(tmp_path)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        client.call("robot.stop")
        answer = client.call("robot.reset")
        assert answer["problems"] == {"left_knee": "its EDS is broken"}
        assert (answer["drives"]["left_knee"], answer["held"]) == ("unknown", True)


def test_a_stop_that_comes_in_between_stays_held(
    client: Client, bench: Bench, hold: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    led: Future[Led] = Future()
    monkeypatch.setattr(bench.left, "reset", lambda _wanted: led)
    resetting = client.request("robot.reset")
    until(lambda: bench.right.resets == 1, "it is under way")
    client.call("robot.stop", reason="no, wait")
    led.set_result(Led(S.SWITCH_ON_DISABLED))
    assert client.answer(resetting)["held"] is True
    assert hold.exists()
    assert client.call("robot.describe")["stop"]["reason"] == "no, wait"


def test_two_resets_do_not_run_at_once(client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    led: Future[Led] = Future()
    monkeypatch.setattr(bench.left, "reset", lambda _wanted: led)
    first = client.request("robot.reset")
    until(lambda: bench.right.resets == 1, "it is under way")
    assert client.refused("robot.reset").kind == "wrong_state"
    bench.left.set_state(DISABLED)
    led.set_result(Led(S.SWITCH_ON_DISABLED))
    assert client.answer(first)["held"] is False
    assert client.call("robot.reset")["held"] is False


def test_a_driver_that_fails_is_told_and_keeps_it_held(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_wanted: object) -> Future[Led]:
        raise RuntimeError("driver bug")

    monkeypatch.setattr(bench.left, "reset", fail)
    answer = client.call("robot.reset")
    assert (answer["problems"], answer["held"]) == ({"left_knee": "driver bug"}, True)


def test_a_record_that_cannot_be_removed_keeps_it_held(
    client: Client, hold: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_path: Path) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr("gateway.records.durable.remove", fail)
    error = client.refused("robot.reset")
    assert error.kind == "unavailable"
    assert "stays held" in str(error)
    assert client.call("robot.describe")["stop"]["held"] is True


def test_a_drive_that_only_sdo_shows_is_not_overtaken_by_the_watch(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The watch asks what it cannot see to stop, which would end the reset of just that drive."""
    led: Future[Led] = Future()
    monkeypatch.setattr(bench.left, "reset", lambda _wanted: led)
    bench.left.latest.clear()
    resetting = client.request("robot.reset")
    until(lambda: bench.right.resets == 1, "it is under way")
    stops = bench.left.stops
    began_ns = client.call("clock.read")["monotonic_ns"]
    until(lambda: client.call("clock.read")["monotonic_ns"] > began_ns + 600_000_000, "it has looked twice")
    assert bench.left.stops == stops
    bench.left.set_state(DISABLED)
    led.set_result(Led(S.SWITCH_ON_DISABLED))
    assert client.answer(resetting)["held"] is False


def test_without_a_held_stop_a_reset_leads_the_drives_down_all_the_same(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        assert client.call("robot.reset")["held"] is False
    assert (bench.left.resets, bench.right.resets) == (1, 1)
