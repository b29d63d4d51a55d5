"""What a gateway leaves of its writes, on disk and in the journal, and what the next one makes of it."""

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from drivers.component import ComponentKind
from gateway.modules.stop.authority import Address
from gateway.records import durable
from gateway.records.journal import Journal, Share
from gateway.records.limits import ENTRIES_AT_ONCE
from tests.support.waiting import until
from tests.unit.gateway.harness import Bench, Client, config, serving
from tests.unit.gateway.tuned import (
    CYCLE,
    CYCLE_TIME,
    LONG_S,
    MAX_TORQUE,
    STEP,
    STEP_LENGTH,
    TORQUE,
    Tuned,
    held,
    somebody_writes,
    tuned,
    u16,
)


def change(address: Address, name: str, old: int, new: int, **more: Any) -> dict[str, Any]:
    bus, node_id, index, subindex = address
    return {
        "parameter": name,
        "component": name.partition(".")[0],
        "bus": bus,
        "node_id": node_id,
        "index": index,
        "subindex": subindex,
        "before": u16(old).hex(),
        "written": u16(new).hex(),
        "before_value": old / 1000,
        "written_value": new / 1000,
    } | more


def entry(write: int, *changes: dict[str, Any], trial: bool = True) -> dict[str, Any]:
    return {"write": write, "who": "gwrms set", "utc_ns": 1, "trial": trial, "changes": changes}


def write_undo(folder: Path, *entries: dict[str, Any]) -> Path:
    path = folder / "state/gwrms/exo-test/undo.json"
    path.parent.mkdir(parents=True)
    path.write_text(json.dumps(entries))
    return path


def found_held(robot: Tuned) -> None:
    """A stop that the last gateway held: it is told, and claims, before anything is taken back."""
    robot.stop()
    robot.tuning.claim()


def test_a_gateway_that_finds_a_held_stop_does_not_take_back_what_that_has_set(
    calm: Bench, tmp_path: Path
) -> None:
    write_undo(tmp_path, entry(7, change(STEP, STEP_LENGTH, 400, 420), change(CYCLE, CYCLE_TIME, 1200, 1300)))
    somebody_writes(calm, STEP, 420)
    somebody_writes(calm, CYCLE, 1300)
    with tuned(tmp_path, STEP, before=found_held) as robot:
        until(lambda: held(calm, CYCLE) == 1200, "the rest is taken back")
        until(lambda: robot.undos() == [], "settled")
        robot.reset()
        assert held(calm, STEP) == 420


@pytest.mark.parametrize(
    ("forged", "says"),
    [
        (change(STEP, "gait.stride", 400, 420), "no longer says that 0x2001:0 of gait is gait.stride"),
        (change(STEP, "gait.0x2001:0", 400, 420), "no longer says that 0x2001:0 of gait is gait.0x2001:0"),
        (change(STEP, CYCLE_TIME, 400, 420), "no longer says that 0x2001:0 of gait is gait.cycle_time"),
        (change(STEP, STEP_LENGTH, 400, 420, component="left_knee"), "node 16 on bus 'main' is left_knee"),
        (change(STEP, STEP_LENGTH, 400, 420, bus="other"), "node 16 on bus 'other' is gait"),
        (change(STEP, STEP_LENGTH, 400, 420, component="tail"), "node 16 on bus 'main' is tail"),
        (change(STEP, STEP_LENGTH, 650, 420), "0.65 m is above the maximum 0.6 m"),
        (change(STEP, STEP_LENGTH, 560, 420), "it may change by 0.1 m at once, not by 0.14"),
        (change(STEP, STEP_LENGTH, 400, 420, before="90010000"), "90 01 00 00 is no UNSIGNED16"),
        (change(STEP, STEP_LENGTH, 400, 420, before=""), " is no UNSIGNED16"),
    ],
)
def test_what_the_robots_file_does_not_say_is_not_written(
    calm: Bench, tmp_path: Path, forged: dict[str, Any], says: str
) -> None:
    """An entry of a table that has changed, or that somebody has made up."""
    path = write_undo(tmp_path, entry(7, forged))
    somebody_writes(calm, STEP, 420)
    with tuned(tmp_path) as robot:
        until(lambda: not path.exists(), "given up")
        (told,) = robot.told("taken back")
    (what,) = told["outcome"].values()
    assert (what.startswith("given up: "), says in what) == (True, True), what
    assert calm.gait.node.written() == calm.left.node.written() == []


def test_what_an_absent_device_holds_is_not_given_up(calm: Bench, tmp_path: Path) -> None:
    path = write_undo(tmp_path, entry(7, change(STEP, STEP_LENGTH, 400, 420)))
    calm.absent["gait"] = (ComponentKind.DEVICE, "gait.eds is broken")
    with tuned(tmp_path) as robot:
        until(lambda: robot.trials()[0].problem == f"{STEP_LENGTH}: unknown: gait.eds is broken", "said")
    assert path.exists()


def test_the_newest_is_taken_back_first_also_when_it_has_to_wait(calm: Bench, tmp_path: Path) -> None:
    """A gateway was killed in the middle of a take-over."""
    write_undo(
        tmp_path,
        entry(9, change(STEP, STEP_LENGTH, 400, 420)),
        entry(8, change(STEP, STEP_LENGTH, 420, 450)),  # its clock was set back
    )
    somebody_writes(calm, STEP, 450)
    calm.gait.node.distrust = "two devices answer as node 16"
    with tuned(tmp_path) as robot:
        until(lambda: all(one.problem for one in robot.trials()), "both have been tried")
        calm.gait.node.distrust = None
        until(lambda: robot.trials() == [], "taken back")
        assert robot.write({STEP_LENGTH: 0.42}) > 9
    assert [data for _, data in calm.gait.node.written()] == [u16(420), u16(400), u16(420)]


def test_a_trial_that_another_gateway_has_begun_is_not_confirmed(calm: Bench, tmp_path: Path) -> None:
    """Nobody has watched over it in between."""
    write_undo(tmp_path, entry(7, change(STEP, STEP_LENGTH, 400, 420)))
    somebody_writes(calm, STEP, 420)
    calm.gait.lost = "no heartbeat yet"  # so that it is not taken back at once
    with tuned(tmp_path) as robot:
        error = robot.refused(lambda: robot.tuning.trials.confirm(7))
        assert "it is being taken back: the gateway ended while it was on trial" in str(error)


def test_what_is_no_entry_makes_the_file_a_damaged_one(calm: Bench, tmp_path: Path) -> None:
    path = write_undo(tmp_path, entry(7, change(STEP, STEP_LENGTH, 400, 420, written="4 times")))
    with tuned(tmp_path) as robot:
        assert (robot.trials(), len(robot.told("undo file damaged"))) == ([], 1)
    assert list(path.parent.glob("undo.json.broken-*"))


@pytest.mark.parametrize(
    "content",
    [pytest.param(b'[{"write": 7, "who": "\xff"}]', id="no-utf-8"), pytest.param(b"[" * 100_000, id="deep")],
)
def test_a_file_that_is_not_even_json_is_a_damaged_one(calm: Bench, tmp_path: Path, content: bytes) -> None:
    path = write_undo(tmp_path)
    path.write_bytes(content)
    with tuned(tmp_path) as robot:
        assert (robot.trials(), len(robot.told("undo file damaged"))) == ([], 1)
    assert list(path.parent.glob("undo.json.broken-*"))


def test_a_write_never_has_the_number_of_what_is_to_be_taken_back(calm: Bench, tmp_path: Path) -> None:
    future = 2**60
    write_undo(tmp_path, entry(future, change(TORQUE, MAX_TORQUE, 1000, 500)))
    calm.left.node.ready = False
    with tuned(tmp_path) as robot:
        assert robot.write({CYCLE_TIME: 1.3}) == future + 1


# On disk and in the journal


@pytest.mark.parametrize(
    ("trial_s", "ending", "order"),
    [
        (None, "", ["+7", "write", "write done", "-7"]),
        (LONG_S, "confirm", ["+7", "write", "trial begun", "+7", "trial confirmed", "-7"]),
        (LONG_S, "revert", ["+7", "write", "trial begun", "+7", "taken back", "-7"]),
    ],
)
def test_whatever_is_begun_has_its_end_in_the_journal_wherever_the_gateway_is_killed(
    robot: Tuned, monkeypatch: pytest.MonkeyPatch, trial_s: float | None, ending: str, order: list[str]
) -> None:
    """The entry is there before its beginning is told, and goes when its end was told."""
    happened: list[str] = []
    append, replace = Journal.append, durable.write
    remove = durable.remove

    def tell(self: Journal, who: str, what: str, *share: Any, **details: Any) -> Any:
        appended = append(self, who, what, *share, **details)
        appended.add_done_callback(lambda _done: happened.append(what))
        return appended

    def write(path: Path, data: bytes) -> None:
        replace(path, data)
        if path.name == "undo.json":
            happened.append("+7")

    def gone(path: Path) -> None:
        remove(path)
        happened.append("-7")

    monkeypatch.setattr(Journal, "append", tell)
    monkeypatch.setattr("gateway.records.durable.write", write)
    monkeypatch.setattr("gateway.records.durable.remove", gone)
    number = robot.write({CYCLE_TIME: 1.3}, trial_s)
    if ending:
        robot.do(lambda: getattr(robot.tuning.trials, ending)(number))
    assert happened == order


def test_a_write_that_was_done_and_not_answered_is_taken_back_and_that_is_told(
    calm: Bench, tmp_path: Path
) -> None:
    """The gateway was killed after the journal had it, and before its entry was dropped."""
    path = write_undo(tmp_path, entry(7, change(STEP, STEP_LENGTH, 400, 420), trial=False))
    somebody_writes(calm, STEP, 420)
    with tuned(tmp_path) as robot:
        until(lambda: not path.exists(), "taken back")
        (told,) = robot.told("taken back")
    assert (told["write"], told["outcome"]) == (7, {STEP_LENGTH: "taken back"})
    assert told["reason"] == "the gateway ended before it had answered it, or taken it back"


def test_a_write_that_cannot_be_journaled_leaves_nothing_to_be_taken_back(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as failing:
        failing.setattr("gateway.records.journal.os.fsync", _no_space)
        failing.setattr("gateway.records.undo.durable.write", lambda _path, _data: None)
        error = robot.refused(robot.writing({CYCLE_TIME: 1.3}))
    assert (error.kind, "nothing was written" in str(error)) == ("unavailable", True)
    assert bench.gait.node.written() == []
    robot.write({CYCLE_TIME: 1.3})
    assert robot.undos() == []
    assert [what for what, _index, _data in bench.gait.node.log].count(
        "upload"
    ) == 3  # nothing was taken back


def test_a_write_beyond_what_one_client_may_write_down_is_refused_and_not_done(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.records.limits.ENTRIES_A_SECOND", 1e-6)  # however slow this machine is
    for _ in range(ENTRIES_AT_ONCE + 1):
        robot.records.journal.append("tester", "lease taken", Share.ASKED)
    error = robot.refused(robot.writing({CYCLE_TIME: 1.3}))
    assert error.kind == "unavailable"
    assert "nothing was written: tester has written more than the journal takes" in str(error)
    assert "try again in" in str(error)
    assert bench.gait.node.written() == []
    assert robot.undos() == []
    robot.session.who = "somebody else"
    robot.write({CYCLE_TIME: 1.3})
    assert len(robot.told("write", "write done")) == 2


def test_what_came_of_a_write_is_told_however_much_its_client_has_written_meanwhile(
    robot: Tuned, bench: Bench
) -> None:
    for _ in range(ENTRIES_AT_ONCE - 1):
        robot.records.journal.append("tester", "lease taken", Share.ASKED)
    robot.write({CYCLE_TIME: 1.3})
    assert len(robot.told("write", "write done")) == 2


def test_a_write_whose_end_cannot_be_kept_is_taken_back(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as failing:
        failing.setattr("gateway.records.undo.durable.remove", _no_space)
        error = robot.refused(robot.writing({CYCLE_TIME: 1.3}))
    assert (error.kind, "this write is taken back" in str(error)) == ("rolled_back", True)
    assert held(bench, CYCLE) == 1200
    assert [one["what"] for one in robot.told("write", "write done", "write taken back")] == [
        "write",
        "write done",
        "write taken back",
    ]
    robot.write({CYCLE_TIME: 1.3})  # nothing stands in its way
    assert robot.undos() == []


def test_a_confirmation_that_cannot_be_kept_is_none_and_the_journal_says_so(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = robot.write({CYCLE_TIME: 1.3}, LONG_S)
    with monkeypatch.context() as failing:
        failing.setattr("gateway.records.undo.durable.remove", _no_space)
        error = robot.refused(lambda: robot.tuning.trials.confirm(write))
    assert (error.kind, "it stays on trial" in str(error)) == ("unavailable", True)
    assert [one["write"] for one in robot.told("trial NOT confirmed")] == [write]
    robot.do(lambda: robot.tuning.trials.confirm(write))
    assert (held(bench, CYCLE), robot.undos()) == (1300, [])


def test_what_was_taken_back_is_so_also_where_that_cannot_be_kept(
    robot: Tuned, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = robot.write({CYCLE_TIME: 1.3}, LONG_S)
    with monkeypatch.context() as failing:
        failing.setattr("gateway.records.undo.durable.remove", _no_space)
        assert robot.revert(write) == {CYCLE_TIME: "taken back"}
    robot.write({CYCLE_TIME: 1.3})
    assert (held(bench, CYCLE), robot.undos()) == (1300, [])


def _no_space(*_given: object) -> None:
    raise OSError(28, "No space left on device")


def test_an_undo_file_that_is_neither_read_nor_put_aside_keeps_writes_from_the_devices(
    calm: Bench, tmp_path: Path
) -> None:
    """And nothing else: control starts, and with it the stop."""
    path = write_undo(tmp_path)
    path.unlink()
    path.mkdir()  # neither can be read, nor be replaced by a file
    (path / "full").touch()
    with no_renaming_of_undo(), serving(config(tmp_path)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        for trial in ({}, {"trial_s": 60}):
            error = client.refused("parameter.write", changes={STEP_LENGTH: 0.44}, **trial)
            assert (error.kind, "move it away" in str(error)) == ("unavailable", True)
        assert calm.gait.node.written() == []
        assert "move it away" in client.call("robot.describe")["records"]["problem"]
        assert client.call("journal.tail", n=9)["entries"][0]["what"] == "undo file damaged"
        assert client.call("robot.stop", reason="all the same")["drives"]["left_knee"] == "confirmed"
    assert path.exists()


@contextlib.contextmanager
def no_renaming_of_undo() -> Iterator[None]:
    """It cannot be put aside."""
    replace = Path.replace

    def keeps_its_name(path: Path, target: Path) -> Path:
        if path.name == "undo.json":
            _no_space()
        return replace(path, target)

    with pytest.MonkeyPatch.context() as failing:
        failing.setattr("gateway.records.undo.Path.replace", keeps_its_name)
        yield
