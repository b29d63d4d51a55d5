"""A held stop on disk: written after the stop has acted, found by the next gateway, never silently lost."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import pytest

from drivers.joint.quick_stop import StopOutcome
from gateway.modules.stop.hold_record import HeldStop, HoldFile
from gateway.modules.stop.stop_control import Asked, _newest_of_each
from gateway.process.futures import done
from gateway.records import durable
from gateway.records.folder import RecordsFolder
from gateway.records.journal import read_verified
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import DISABLED, ENABLED, HEAD, ROBOT, Bench, Client, config, serving

LINGER = ROBOT.replace("linger_s = 0.05", 'linger_s = 0\nrecords = "records"')


def folder(tmp_path: Path) -> RecordsFolder:
    return RecordsFolder(tmp_path / "records")


def entries(tmp_path: Path) -> list[dict[str, Any]]:
    return read_verified(folder(tmp_path).journal)


def said(tmp_path: Path) -> list[str]:
    return [one["what"] for one in entries(tmp_path)] if folder(tmp_path).journal.exists() else []


def test_a_stop_acts_before_it_is_written_down(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stopped_then: list[tuple[int, int]] = []
    write = durable.write

    def watch(path: Path, data: bytes) -> None:
        stopped_then.append((bench.left.stops, bench.right.stops))
        write(path, data)

    monkeypatch.setattr("gateway.records.durable.write", watch)
    with serving(config(tmp_path, LINGER)) as address, Client(address) as client:
        answer = client.call("robot.stop", reason="first things first")
        assert (answer["problem"], folder(tmp_path).hold.exists()) == (None, True)
    assert stopped_then[0] == (1, 1)


def test_a_stop_is_journaled_with_who_why_and_what_came_of_it(bench: Bench, tmp_path: Path) -> None:
    bench.right.stopping = StopOutcome.UNCONFIRMED
    with serving(config(tmp_path, LINGER)) as address, Client(address) as client:
        client.call("hello", client="desk", protocol=1)
        client.call("robot.stop", reason="the patient stumbles")
    (stop,) = [one for one in entries(tmp_path) if one["what"] == "stop"]
    (answered,) = [one for one in entries(tmp_path) if one["what"] == "stop answered"]
    assert stop["reason"] == "the patient stumbles"
    assert stop["who"].startswith("desk (")
    assert answered["result"] == {"left_knee": "confirmed", "right_knee": "unconfirmed"}


def test_nobodys_stop_is_lost_in_the_journal_among_anothers(tmp_path: Path) -> None:
    """Those that come while the disk is busy are written at once; each of those who asked is told."""
    told: list[tuple[str, str]] = []
    busy, written = threading.Event(), Future[None]()
    written.set_result(None)

    def wrote(held: HeldStop, _problem: str | None) -> "Future[None]":
        busy.wait(WAIT_S)
        told.append((held.who, held.reason))
        return written

    hold = HoldFile(tmp_path / "stop.json", None, wrote)
    for who, reason in (("ben", "a"), ("ben", "b"), ("ada", "1"), ("cleo", "c"), ("ada", "2"), ("ada", "3")):
        hold.write(who, reason)
    busy.set()
    hold.close()
    assert {who for who, _ in told} == {"ben", "ada", "cleo"}
    assert told[-1] == ("ada", "3")
    assert ("ben", "b") in told


def test_stops_at_one_time_are_one_stop_and_an_entry_of_everybody() -> None:
    stops = [Asked("ben", "b"), *(Asked("ada", str(number)) for number in range(9))]
    found = _newest_of_each([*stops, Asked("cleo", "c"), stops[1]])
    assert [(one.who, one.reason) for one in found] == [("ben", "b"), ("cleo", "c"), ("ada", "0")]


def test_the_next_gateway_holds_it_without_any_client(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path, LINGER)) as address, Client(address) as client:
        client.call("robot.stop", reason="before the end")
    stops = bench.left.stops
    bench.left.set_state(ENABLED)
    with serving(config(tmp_path, LINGER)) as address:
        until(lambda: bench.left.stops > stops, "stopped again though nobody asks")
        bench.right.set_state(ENABLED)
        until(lambda: bench.right.stops > 1, "and again")
        with Client(address) as client:
            stop = client.call("robot.describe")["stop"]
            assert (stop["held"], stop["reason"]) == (True, "before the end")
            assert stop["since_ns"] > 0
        assert bench.left.stopped == 1
    assert "stop still held" in said(tmp_path)


def test_a_gateway_with_nothing_unfinished_opens_nothing(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path, LINGER)) as address, Client(address) as client:
        client.call("clock.read")
        assert bench.assembled == 0


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b'{"who": 5}',
        b"\xff\xfe",
        pytest.param(b'{"who": "\xff"}', id="no-utf-8"),
        pytest.param(b'{"z": ' + b"[" * 100_000, id="deep"),
    ],
)
def test_a_record_that_cannot_be_read_is_a_held_stop(bench: Bench, tmp_path: Path, content: bytes) -> None:
    (tmp_path / "records").mkdir()
    folder(tmp_path).hold.write_bytes(content)
    with serving(config(tmp_path, LINGER)) as address, Client(address) as client:
        until(lambda: bench.left.stops, "stopped")
        stop = client.call("robot.describe")["stop"]
        assert stop["held"] is True
        assert "cannot be read" in stop["reason"]
        client.call("control.acquire", ttl_s=60)
        assert client.call("robot.reset")["held"] is False
    assert not folder(tmp_path).hold.exists()


def test_a_folder_that_cannot_be_used_stops_nobody_from_stopping(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "records").write_text("this is no folder")
    with serving(config(tmp_path, LINGER)) as address, Client(address) as client:
        answer = client.call("robot.stop", reason="all the same")
        assert answer["drives"] == {"left_knee": "confirmed", "right_knee": "confirmed"}
        assert answer["held"] is True
        assert answer["problem"].startswith("this stop is held, but not beyond this gateway: ")
        assert client.call("robot.describe")["stop"]["problem"] == answer["problem"]
        bench.left.set_state(ENABLED)
        until(lambda: bench.left.stops == 2, "held as long as it lives")


def test_a_disk_that_hangs_delays_neither_the_stop_nor_its_answer(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on: Future[None] = Future()
    write = durable.write

    def hang(path: Path, data: bytes) -> None:
        if path.name == "stop.json":
            go_on.result(WAIT_S)
        write(path, data)

    monkeypatch.setattr("gateway.records.durable.write", hang)
    text = LINGER + "[stop]\ntimeout_s = 0.2\n"
    with serving(config(tmp_path, text)) as address, Client(address) as client:
        answer = client.call("robot.stop", reason="a full disk")
        assert answer["drives"] == {"left_knee": "confirmed", "right_knee": "confirmed"}
        assert "nobody knows yet" in answer["problem"]
        go_on.set_result(None)
        until(lambda: client.call("robot.describe")["stop"]["problem"] is None, "written in the end")
    assert folder(tmp_path).hold.exists()


def test_a_drive_enabled_again_and_again_does_not_flood_the_journal(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path, LINGER)) as address, Client(address) as client:
        client.call("robot.stop")
        for times in range(1, 21):
            bench.left.set_state(ENABLED)
            until(partial(stopped_again, client, times), "stopped again")
    assert said(tmp_path).count("stopped again") == 1


def stopped_again(client: Client, times: int) -> bool:
    counts: dict[str, int] = client.call("robot.describe")["stop"]["stopped_again"]
    return counts["left_knee"] == times


def test_a_second_stop_keeps_since_when_and_tells_the_newer_reason(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path, LINGER)) as address, Client(address) as client:
        client.call("robot.stop", reason="first")
        first = client.call("robot.describe")["stop"]
        client.call("robot.stop", reason="second")
        second = client.call("robot.describe")["stop"]
    assert second["since_ns"] == first["since_ns"]
    assert (first["reason"], second["reason"]) == ("first", "second")


def test_a_folder_that_may_not_be_read_counts_as_unfinished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def forbidden(_path: Path) -> bool:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "exists", forbidden)
    assert RecordsFolder(tmp_path).unfinished is True


def test_the_module_that_stops_is_there_as_soon_as_somebody_watches(
    connect: Callable[[], Client], bench: Bench
) -> None:
    client = connect()
    client.call("component.snapshot")
    until(lambda: client.call("robot.describe")["modules"]["control"] == "running")


def test_a_robot_without_joints_is_stopped_by_nobody_and_says_so(tmp_path: Path) -> None:
    with serving(config(tmp_path, HEAD)) as address, Client(address) as client:
        assert client.call("robot.stop")["drives"] == {}


def test_what_stays_stopped_is_left_alone_after_a_restart_too(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path, LINGER)) as address, Client(address) as client:
        client.call("robot.stop")
    bench.left.set_state(DISABLED)
    bench.right.set_state(DISABLED)
    with serving(config(tmp_path, LINGER)) as address, Client(address) as client:
        until(lambda: client.call("robot.describe")["stop"]["held"], "held again")
        began_ns = client.call("clock.read")["monotonic_ns"]
        until(
            lambda: client.call("clock.read")["monotonic_ns"] > began_ns + 600_000_000, "it has looked twice"
        )
        assert (bench.left.stops, bench.right.stops) == (1, 1)


def test_a_stop_that_is_held_while_the_record_of_another_waits_to_be_removed_keeps_its_own(
    tmp_path: Path,
) -> None:
    """The disk is slow: the first stop is not written yet when its reset has come to its end."""
    disk = threading.Event()
    hold = HoldFile(tmp_path / "stop.json", None, lambda _held, _problem: done(None))
    hold._writer.submit(disk.wait)
    hold.write("first", "stumbles")
    removed = hold.remove()
    hold.write("second", "falls")
    disk.set()
    hold.close()
    assert removed.done()
    found = msgspec.json.decode((tmp_path / "stop.json").read_bytes(), type=HeldStop)
    assert (found.who, found.reason) == ("second", "falls")
