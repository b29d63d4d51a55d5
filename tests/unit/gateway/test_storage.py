"""Store and restore through the wire: only where it can, at rest, not on trial, verified and recorded."""

import json
import threading
from pathlib import Path
from typing import Any

import pytest

from drivers.errors import DeviceAbort, DeviceTimeout, Unavailable
from gateway.config import RobotConfig
from gateway.modules.control.storage import STORING
from gateway.records.journal import Journal
from tests.support.waiting import WAIT_S
from tests.unit.gateway.harness import (
    DISABLED,
    ENABLED,
    HEAD,
    QUICK_STOPPED,
    ROBOT,
    Bench,
    Client,
    config,
    serving,
)
from tests.unit.gateway.tuned import tuned

STORE, RESTORE, TORQUE = 0x1010, 0x1011, 0x6072
FAULT_REACTION, SWITCHED_ON, FAULT, NO_STATE = 0x021F, 0x0233, 0x0218, 0x006F


def u32(value: int) -> bytes:
    return value.to_bytes(4, "little")


@pytest.fixture
def resting(bench: Bench) -> Bench:
    """Both drives off; the left one stores on command."""
    for drive in (bench.left, bench.right):
        drive.set_state(DISABLED)
        drive.node.objects |= {(STORE, 1): u32(1), (RESTORE, 1): u32(1)}
        drive.node.store = lambda index, data: u32(1) if index in (STORE, RESTORE) else data
    bench.gait.node.objects |= {(STORE, 1): u32(1)}
    return bench


@pytest.fixture
def writer(client: Client) -> Client:
    client.call("control.acquire", ttl_s=60)
    return client


def journal(client: Client) -> list[dict[str, Any]]:
    return [one for one in client.call("journal.tail", n=50)["entries"] if "component" in one]


# What it does


def test_store_sends_save_lsb_first_and_answers_what_was_done(resting: Bench, writer: Client) -> None:
    answer = writer.call("parameter.store", component="left_knee")
    assert answer == {"component": "left_knee", "result": "stored, and it still holds the same values"}
    assert resting.left.node.written() == [(STORE, b"save")]
    assert resting.right.node.written() == []


def test_restore_sends_load_and_says_when_it_acts(resting: Bench, writer: Client) -> None:
    answer = writer.call("parameter.restore", component="left_knee")
    assert "its defaults act after its next reset" in answer["result"]
    assert resting.left.node.written() == [(RESTORE, b"load")]


def test_begin_and_end_are_in_the_journal_before_the_answer(resting: Bench, writer: Client) -> None:
    seen: list[str] = []
    records = Path(writer.call("robot.describe")["records"]["folder"]) / "journal.jsonl"

    def look(index: int, data: bytes) -> None:
        seen.extend(json.loads(line)["what"] for line in records.read_text().splitlines())

    resting.left.node.before_download = look
    writer.call("parameter.store", component="left_knee")
    assert seen[-1] == "store"
    begin, end = journal(writer)
    assert (begin["what"], begin["component"], begin["who"]) == ("store", "left_knee", end["who"])
    assert (end["what"], end["result"]) == ("store done", "stored, and it still holds the same values")


def test_a_device_that_is_busy_afterwards_is_asked_until_it_answers(resting: Bench, writer: Client) -> None:
    deaf = [DeviceTimeout("busy"), DeviceTimeout("busy")]

    def upload(index: int) -> None:
        if index == STORE and resting.left.node.written() and deaf:
            raise deaf.pop()

    resting.left.node.before_upload = upload
    assert writer.call("parameter.store", component="left_knee")["result"].startswith("stored")
    assert deaf == []


# What refuses it


def test_without_the_lease_nothing_is_stored(resting: Bench, client: Client) -> None:
    for method in ("parameter.store", "parameter.restore"):
        assert client.refused(method, component="left_knee").kind == "no_lease"
    assert resting.left.node.log == []


@pytest.mark.parametrize("name", ["left_insole", "left_hip", "*"])
def test_what_is_no_can_device_has_nothing_to_store(resting: Bench, writer: Client, name: str) -> None:
    error = writer.refused("parameter.store", component=name)
    assert error.kind == "unknown_name"
    assert "left_knee, right_knee, gait" in str(error)


@pytest.mark.parametrize(
    ("capability", "words"),
    [
        (u32(0), "it cannot (0x1010:1 reads 0x00000000)"),
        (u32(2), "it does that by itself, not on command (0x1010:1 reads 0x00000002)"),
    ],
)
def test_a_device_that_says_it_cannot_is_not_asked(
    resting: Bench, writer: Client, capability: bytes, words: str
) -> None:
    resting.left.node.objects[STORE, 1] = capability
    error = writer.refused("parameter.store", component="left_knee")
    assert (error.kind, error.data["object"]) == ("not_allowed", "0x1010:1")
    assert words in str(error)
    assert resting.left.node.written() == []
    (told,) = journal(writer)
    assert (told["what"], told["component"], told["result"]) == ("store refused", "left_knee", str(error))


def test_a_device_without_the_object_says_so_itself(resting: Bench, writer: Client) -> None:
    error = writer.refused("parameter.restore", component="gait")
    assert (error.kind, error.data["abort_code"]) == ("device_abort", 0x0602_0000)


@pytest.mark.parametrize("state", [ENABLED, QUICK_STOPPED, FAULT_REACTION, NO_STATE])
def test_a_drive_that_may_move_or_is_in_no_known_state_is_not_disturbed(
    resting: Bench, writer: Client, state: int
) -> None:
    resting.left.set_state(state)
    for method in ("parameter.store", "parameter.restore"):
        error = writer.refused(method, component="left_knee")
        assert error.kind == "wrong_state"
        assert "the state of left_knee is" in str(error)
    assert resting.left.node.written() == []


@pytest.mark.parametrize("state", [DISABLED, SWITCHED_ON, FAULT])
def test_a_drive_that_stands_still_stores_whatever_the_others_do(
    resting: Bench, writer: Client, state: int
) -> None:
    resting.left.set_state(state)
    resting.right.set_state(ENABLED)
    assert writer.call("parameter.store", component="left_knee")["result"].startswith("stored")


def test_a_drive_that_does_not_tell_its_state_is_not_disturbed(resting: Bench, writer: Client) -> None:
    del resting.left.node.objects[0x6041, 0]
    error = writer.refused("parameter.store", component="left_knee")
    assert (error.kind, "unknown" in str(error)) == ("wrong_state", True)


def test_the_controller_of_every_drive_stores_only_when_all_of_them_rest(
    resting: Bench, writer: Client
) -> None:
    resting.right.set_state(ENABLED)
    error = writer.refused("parameter.store", component="gait")
    assert (error.kind, "right_knee is operation enabled" in str(error)) == ("wrong_state", True)
    resting.right.set_state(DISABLED)
    assert writer.call("parameter.store", component="gait")["component"] == "gait"


def test_what_is_on_trial_is_never_made_permanent(resting: Bench, writer: Client) -> None:
    trial = writer.call("parameter.write", changes={"left_knee.max_torque": 90}, trial_s=60)
    for method in ("parameter.store", "parameter.restore"):
        error = writer.refused(method, component="left_knee")
        assert error.kind == "trial_pending"
        assert "left_knee.max_torque: on trial; confirm or revert that first" in str(error)
        assert f"(write {trial['write']} of" in str(error)
    # Taking it back, when its time is over, must not wait for another device either.
    assert writer.refused("parameter.store", component="right_knee").kind == "trial_pending"
    writer.call("parameter.confirm", write=trial["write"])
    assert writer.call("parameter.store", component="left_knee")["component"] == "left_knee"


def test_a_store_waits_for_the_write_before_it(resting: Bench, writer: Client) -> None:
    began, go_on = threading.Event(), threading.Event()

    def wait(index: int, data: bytes) -> None:
        if index == TORQUE:
            began.set()
            assert go_on.wait(WAIT_S)

    resting.left.node.before_download = wait
    write = writer.request("parameter.write", changes={"left_knee.max_torque": 90})
    assert began.wait(WAIT_S)
    store = writer.request("parameter.store", component="left_knee")
    assert resting.left.node.written() == [(TORQUE, (900).to_bytes(2, "little"))]
    go_on.set()
    writer.answer(write)
    assert writer.answer(store)["result"].startswith("stored")
    assert [index for index, _ in resting.left.node.written()] == [TORQUE, STORE]


def test_without_a_journal_nothing_is_stored(resting: Bench, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    text = ROBOT.replace("port = 0", 'port = 0\nrecords = "taken"')
    with serving(config(tmp_path, text)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        error = client.refused("parameter.store", component="left_knee")
        assert (error.kind, "nothing was sent" in str(error)) == ("unavailable", True)
    assert resting.left.node.written() == []


def test_what_was_asked_for_before_a_stop_is_not_stored_after_it(resting: Bench, tmp_path: Path) -> None:
    def stop(_index: int, _data: bytes) -> None:
        robot.do(lambda: stored.append(robot.tuning.store(STORING, robot.session, "left_knee")))
        robot.stop()

    stored: list[Any] = []
    with tuned(tmp_path) as robot:
        resting.gait.node.before_download = stop
        robot.ask(robot.writing({"gait.cycle_time": 1.3})).exception(WAIT_S)
        error = stored[0].exception(WAIT_S)
    assert (error.kind, "nothing was sent" in str(error)) == ("stopped", True)
    assert resting.left.node.log == []


def test_a_stop_at_the_last_moment_keeps_the_command_from_the_bus(resting: Bench, tmp_path: Path) -> None:
    download = resting.left.node.download

    def stopped(index: int, subindex: int, data: bytes, *given: Any, **named: Any) -> Any:
        robot.stop()
        return download(index, subindex, data, *given, **named)

    resting.left.node.download = stopped  # type: ignore[method-assign]
    with tuned(tmp_path) as robot:
        error = robot.refused(lambda: robot.tuning.store(STORING, robot.session, "left_knee"))
        assert [one["what"] for one in robot.told("store", "store FAILED")] == ["store", "store FAILED"]
    assert (error.kind, "nothing was sent" in str(error)) == ("stopped", True)
    assert resting.left.node.written() == []


def test_a_drive_that_was_enabled_while_the_command_was_recorded_is_not_disturbed(
    resting: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    append = Journal.append

    def slow(self: Journal, who: str, what: str, *share: Any, **details: Any) -> Any:
        if what == "store":
            resting.left.set_state(ENABLED)
        return append(self, who, what, *share, **details)

    monkeypatch.setattr(Journal, "append", slow)
    with tuned(tmp_path) as robot:
        assert (
            robot.refused(lambda: robot.tuning.store(STORING, robot.session, "left_knee")).kind
            == "wrong_state"
        )
    assert resting.left.node.written() == []


def test_a_node_that_is_not_trusted_stores_nothing(resting: Bench, writer: Client) -> None:
    resting.left.node.distrust = "two devices answer as node 2"
    error = writer.refused("parameter.store", component="left_knee")
    assert (error.kind, "two devices answer as node 2" in str(error)) == ("not_allowed", True)
    assert resting.left.node.written() == []


# What goes wrong


@pytest.mark.parametrize("error_", [DeviceTimeout("no answer within 10 s"), Unavailable("bus off")])
def test_no_answer_means_that_nobody_knows(resting: Bench, writer: Client, error_: Exception) -> None:
    def fail(index: int, data: bytes) -> None:
        raise error_

    resting.left.node.before_download = fail
    error = writer.refused("parameter.store", component="left_knee")
    assert (error.kind, error.data["component"]) == ("device_timeout", "left_knee")
    assert "NOBODY KNOWS whether it did" in str(error)
    begin, end = journal(writer)
    assert (begin["what"], end["what"]) == ("store", "store FAILED")
    assert "NOBODY KNOWS" in end["result"]


@pytest.mark.parametrize("object_", [STORE, TORQUE])
def test_a_silence_before_the_command_leaves_nothing_unknown(
    resting: Bench, writer: Client, object_: int
) -> None:
    def fail(index: int) -> None:
        if index == object_:
            raise DeviceTimeout("silence")

    resting.left.node.before_upload = fail
    error = writer.refused("parameter.store", component="left_knee")
    assert (error.kind, "nothing was sent" in str(error)) == ("unavailable", True)
    assert resting.left.node.written() == []


@pytest.mark.parametrize("object_", [STORE, TORQUE])
def test_what_cannot_be_looked_at_after_it_has_confirmed_is_not_refused(
    resting: Bench, writer: Client, object_: int
) -> None:
    def fail(index: int) -> None:
        if index == object_ and resting.left.node.written():
            raise Unavailable("bus off")

    resting.left.node.before_upload = fail
    error = writer.refused("parameter.store", component="left_knee")
    assert (error.kind, "the device confirmed, but then" in str(error)) == ("device_timeout", True)


def test_what_was_stored_but_could_not_be_recorded_is_not_refused(
    resting: Bench, writer: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    append = Journal.append

    def full(self: Journal, who: str, what: str, *share: Any, **details: Any) -> Any:
        if what == "store done":
            raise OSError(28, "No space left on device")
        return append(self, who, what, *share, **details)

    monkeypatch.setattr(Journal, "append", full)
    error = writer.refused("parameter.store", component="left_knee")
    assert (error.kind, "could not be recorded: No space left" in str(error)) == ("mismatch", True)
    assert "stored, and it still holds" in str(error)


def test_a_refusal_of_the_device_is_told_with_its_code(resting: Bench, writer: Client) -> None:
    def refuse(index: int, data: bytes) -> None:
        raise DeviceAbort("cannot be transferred or stored because of the device state", 0x0800_0022)

    resting.left.node.before_download = refuse
    error = writer.refused("parameter.restore", component="left_knee")
    assert (error.kind, error.data["abort_code"]) == ("device_abort", 0x0800_0022)
    assert [one["what"] for one in journal(writer)] == ["restore", "restore FAILED"]


def test_a_value_that_storing_has_changed_is_named(resting: Bench, writer: Client) -> None:
    def change(index: int, data: bytes) -> None:
        resting.left.node.objects[TORQUE, 0] = (500).to_bytes(2, "little")

    resting.left.node.before_download = change
    error = writer.refused("parameter.store", component="left_knee")
    assert error.kind == "mismatch"
    assert "left_knee.max_torque was 100 and is 50" in str(error)


def test_a_device_that_stays_deaf_after_storing_is_an_error(resting: Bench, tmp_path: Path) -> None:
    def upload(index: int) -> None:
        if index == STORE and resting.left.node.written():
            raise DeviceTimeout("silence")

    resting.left.node.before_upload = upload
    impatient = ROBOT.replace("node_id = 2\n", "node_id = 2\nstore_timeout_s = 0.05\n")
    with serving(config(tmp_path, impatient)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        error = client.refused("parameter.store", component="left_knee")
        assert (error.kind, "the device confirmed, but then" in str(error)) == ("device_timeout", True)


# Who shares a node


@pytest.fixture
def two_axes(tmp_path: Path) -> RobotConfig:
    drive = 'bus = "main"\neds = "drive.eds"\ncounts_per_revolution = 4096\ngear_ratio = 100.0\n'
    table = "[joint.{}]\nnode_id = {}\naxis = {}\n" + drive
    gait = '[device.gait]\nbus = "main"\nnode_id = 16\neds = "gait_controller.eds"\n'
    joints = (("knee", 2, 0), ("ankle", 2, 1), ("hip", 3, 0))
    return config(tmp_path, HEAD + "".join(table.format(*one) for one in joints) + gait)


@pytest.mark.parametrize(
    ("component", "sharing", "drives"),
    [
        ("knee", ("knee", "ankle"), ("knee", "ankle")),
        ("ankle", ("knee", "ankle"), ("knee", "ankle")),
        ("hip", ("hip",), ("hip",)),
        ("gait", ("gait",), ("knee", "ankle", "hip")),
    ],
)
def test_the_axes_of_one_drive_count_together(
    two_axes: RobotConfig, component: str, sharing: tuple[str, ...], drives: tuple[str, ...]
) -> None:
    assert (two_axes.sharing(component), two_axes.drives_of(component)) == (sharing, drives)
