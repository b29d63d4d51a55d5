"""Trials: applied at once, and taken back unless confirmed, whatever becomes of client, lease and gateway."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from drivers.errors import DeviceTimeout
from gateway.records.journal import read_verified
from tests.support.waiting import until
from tests.unit.gateway.harness import Bench, Client, config, serving

STEP, CYCLE = (0x2001, 0), (0x2002, 0)


@pytest.fixture
def writer(client: Client) -> Client:
    client.call("control.acquire", ttl_s=60)
    return client


def held(bench: Bench, key: tuple[int, int] = STEP) -> int:
    return int.from_bytes(bench.gait.node.objects[key], "little")


def try_(client: Client, trial_s: float = 100.0, **changes: float) -> dict[str, Any]:
    named = {f"gait.{name}": value for name, value in changes.items()}
    answer: dict[str, Any] = client.call("parameter.write", changes=named, trial_s=trial_s)
    return answer


def trials(client: Client) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = client.call("robot.describe")["trials"]
    return found


def journal(folder: Path) -> list[dict[str, Any]]:
    return read_verified(folder / "state/gwrms/exo-test/journal.jsonl")


def undo_file(folder: Path) -> Path:
    return folder / "state/gwrms/exo-test/undo.json"


def test_a_trial_is_applied_at_once_and_reverts_when_its_time_is_over(writer: Client, bench: Bench) -> None:
    written = try_(writer, 0.2, step_length=0.42)
    assert written["trial_s"] == 0.2
    assert (written["before"], written["after"]) == ({"gait.step_length": 0.4}, {"gait.step_length": 0.42})
    assert [data for _, data in bench.gait.node.written()] == [(420).to_bytes(2, "little")]
    until(lambda: held(bench) == 400, "reverted")
    until(lambda: trials(writer) == [], "ended")
    error = writer.refused("parameter.confirm", write=written["write"])
    assert error.kind == "unknown_name"
    assert "time ran out" in str(error)


def test_what_is_on_trial_is_described(writer: Client) -> None:
    written = try_(writer, step_length=0.42)
    (trial,) = trials(writer)
    assert (trial["write"], trial["values"]) == (written["write"], {"gait.step_length": 0.42})
    assert trial["before"] == {"gait.step_length": 0.4}
    assert 90 < trial["left_s"] <= 100


def test_a_confirmed_trial_stays(writer: Client, bench: Bench, tmp_path: Path) -> None:
    written = try_(writer, 0.5, step_length=0.42)
    assert undo_file(tmp_path).exists()
    answer = writer.call("parameter.confirm", write=written["write"])
    assert answer == {"write": written["write"], "values": {"gait.step_length": 0.42}}
    assert not undo_file(tmp_path).exists()
    assert "it was confirmed" in str(writer.refused("parameter.revert", write=written["write"]))
    writer.call("control.release")
    assert held(bench) == 420


def test_a_trial_can_be_reverted_by_hand(writer: Client, bench: Bench) -> None:
    written = try_(writer, step_length=0.42, cycle_time=1.25)
    answer = writer.call("parameter.revert", write=written["write"])
    assert answer["outcome"] == {"gait.step_length": "taken back", "gait.cycle_time": "taken back"}
    assert (held(bench), held(bench, CYCLE)) == (400, 1200)
    assert "asked for" in str(writer.refused("parameter.revert", write=written["write"]))


def test_confirming_and_reverting_need_the_lease(
    writer: Client, connect: Callable[[], Client], bench: Bench
) -> None:
    written = try_(writer, step_length=0.42)
    other = connect()
    assert other.refused("parameter.confirm", write=written["write"]).kind == "no_lease"
    assert other.refused("parameter.revert", write=written["write"]).kind == "no_lease"
    assert held(bench) == 420


def test_a_client_that_vanishes_takes_its_trial_with_it(
    connect: Callable[[], Client], bench: Bench, tmp_path: Path
) -> None:
    client, other = connect(), connect()
    client.call("control.acquire", ttl_s=60)
    try_(client, step_length=0.42)
    client.close()
    until(lambda: held(bench) == 400, "reverted")
    until(lambda: trials(other) == [], "ended")
    assert not undo_file(tmp_path).exists()
    assert "connection" in other.call("journal.tail", n=1)["entries"][0]["reason"]


def test_a_client_that_vanishes_while_its_trial_is_written_takes_it_with_it(
    connect: Callable[[], Client], bench: Bench
) -> None:
    client, other = connect(), connect()
    client.call("control.acquire", ttl_s=60)
    bench.gait.node.before_download = lambda _index, _data: client.close()
    client.request("parameter.write", changes={"gait.step_length": 0.42}, trial_s=100)
    until(lambda: len(bench.gait.node.written()) == 2, "written and taken back")
    assert held(bench) == 400
    until(lambda: trials(other) == [], "ended")


@pytest.mark.parametrize("how", ["released", "ran out"])
def test_a_lease_that_ends_ends_the_trial(writer: Client, bench: Bench, how: str) -> None:
    try_(writer, step_length=0.42)
    if how == "released":
        writer.call("control.release")
    else:
        writer.call("control.acquire", ttl_s=0.1)
    until(lambda: held(bench) == 400, "reverted")


def test_a_stop_does_not_keep_a_trial_from_being_taken_back(writer: Client, bench: Bench) -> None:
    written = try_(writer, step_length=0.42)
    writer.call("robot.stop", reason="test")
    assert writer.call("parameter.revert", write=written["write"])["outcome"] == {
        "gait.step_length": "taken back"
    }
    assert held(bench) == 400


def test_a_new_trial_takes_over_and_keeps_the_first_value(writer: Client, bench: Bench) -> None:
    first = try_(writer, step_length=0.42, cycle_time=1.25)
    second = try_(writer, step_length=0.45)
    assert second["before"] == {"gait.step_length": 0.4, "gait.cycle_time": 1.2}
    assert second["after"] == {"gait.step_length": 0.45, "gait.cycle_time": 1.25}
    assert [trial["write"] for trial in trials(writer)] == [second["write"]]
    assert f"write {second['write']}" in str(writer.refused("parameter.confirm", write=first["write"]))
    writer.call("parameter.revert", write=second["write"])
    assert (held(bench), held(bench, CYCLE)) == (400, 1200)


def test_a_new_trial_that_fails_leaves_the_old_one(writer: Client, bench: Bench) -> None:
    first = try_(writer, step_length=0.42)

    def refuse_the_next(_index: int, _data: bytes) -> None:
        bench.gait.node.before_download = lambda _index, _data: None
        raise DeviceTimeout("gait: no answer")

    bench.gait.node.before_download = refuse_the_next
    assert writer.refused("parameter.write", changes={"gait.step_length": 0.45}, trial_s=50).kind in (
        "device_timeout",
        "rolled_back",
    )
    assert held(bench) == 420
    writer.call("parameter.revert", write=first["write"])
    assert held(bench) == 400


def test_a_plain_write_of_what_is_on_trial_is_refused(writer: Client, bench: Bench) -> None:
    first = try_(writer, step_length=0.42)
    error = writer.refused("parameter.write", changes={"gait.cycle_time": 1.3, "gait.step_length": 0.45})
    assert error.kind == "trial_pending"
    assert str(first["write"]) in str(error)
    assert (held(bench), held(bench, CYCLE)) == (420, 1200)


def test_what_somebody_else_has_changed_is_left_alone_and_said(
    writer: Client, bench: Bench, tmp_path: Path
) -> None:
    written = try_(writer, step_length=0.42, cycle_time=1.25)
    bench.gait.node.objects[STEP] = (333).to_bytes(2, "little")
    assert writer.refused("parameter.confirm", write=written["write"]).kind == "mismatch"
    outcome = writer.call("parameter.revert", write=written["write"])["outcome"]
    assert outcome["gait.cycle_time"] == "taken back"
    assert outcome["gait.step_length"].startswith("left alone: it holds 4d 01")
    assert held(bench) == 333
    assert journal(tmp_path)[-1]["outcome"] == outcome


def test_what_cannot_be_taken_back_is_said_and_tried_until_it_can(writer: Client, bench: Bench) -> None:
    written = try_(writer, step_length=0.42)
    bench.gait.lost, bench.gait.node.ready = "no frame of node 16", False
    error = writer.refused("parameter.revert", write=written["write"])
    assert error.kind == "rollback_failed"
    assert "no frame of node 16" in str(error)
    again = writer.refused("parameter.write", changes={"gait.step_length": 0.45}, trial_s=9)
    assert again.kind in ("trial_pending", "unavailable")
    (trial,) = trials(writer)
    assert trial["left_s"] is None
    assert "no frame of node 16" in trial["problem"]
    assert writer.refused("parameter.confirm", write=written["write"]).kind == "unknown_name"
    bench.gait.node.ready = True
    until(lambda: held(bench) == 400, "taken back")
    until(lambda: trials(writer) == [], "ended")


def test_a_trial_outlives_its_module_but_not_its_gateway(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        try_(client, step_length=0.42)
    assert held(bench) == 400
    assert not undo_file(tmp_path).exists()


@pytest.fixture
def crashed(bench: Bench, tmp_path: Path) -> Path:
    """What a gateway leaves that was killed while a trial was on and a plain write half done."""
    place = {"component": "gait", "bus": "main", "node_id": 16, "subindex": 0}
    undos = [
        {
            "write": 7,
            "who": "gwrms set",
            "utc_ns": 1,
            "trial": True,
            "changes": [_change("gait.step_length", 0x2001, 400, 420, place)],
        },
        {
            "write": 8,
            "who": "gwrms set",
            "utc_ns": 2,
            "trial": False,
            "changes": [
                _change("gait.cycle_time", 0x2002, 1200, 1250, place),
                _change("gait.toe_height", 0x2003, 80, 90, place),
            ],
        },
    ]
    bench.gait.node.objects |= {STEP: (420).to_bytes(2, "little"), CYCLE: (1250).to_bytes(2, "little")}
    undo_file(tmp_path).parent.mkdir(parents=True)
    undo_file(tmp_path).write_text(json.dumps(undos))
    return undo_file(tmp_path)


def _change(name: str, index: int, before: int, written: int, place: dict[str, Any]) -> dict[str, Any]:
    return place | {
        "parameter": name,
        "index": index,
        "before": before.to_bytes(2, "little").hex(),
        "written": written.to_bytes(2, "little").hex(),
        "before_value": before / 1000,
        "written_value": written / 1000,
    }


def test_what_a_crash_left_is_taken_back_when_the_module_starts(
    crashed: Path, bench: Bench, tmp_path: Path
) -> None:
    with serving(config(tmp_path)) as address, Client(address) as client:
        client.call("parameter.list")
        until(lambda: (held(bench), held(bench, CYCLE)) == (400, 1200), "taken back")
        until(lambda: not crashed.exists(), "forgotten")
    outcomes = {one["write"]: one["outcome"] for one in journal(tmp_path) if one["what"] == "taken back"}
    assert outcomes == {
        7: {"gait.step_length": "taken back"},
        8: {"gait.cycle_time": "taken back", "gait.toe_height": "unchanged"},
    }


def test_what_a_crash_left_is_not_taken_back_from_another_device(
    crashed: Path, bench: Bench, tmp_path: Path
) -> None:
    undos = json.loads(crashed.read_text())
    undos[0]["changes"][0]["node_id"] = 17
    crashed.write_text(json.dumps(undos[:1]))
    with serving(config(tmp_path)) as address, Client(address) as client:
        client.call("parameter.list")
        until(lambda: not crashed.exists(), "given up")
    assert held(bench) == 420
    assert "node 17 on bus 'main'" in journal(tmp_path)[-1]["outcome"]["gait.step_length"]


def test_a_damaged_undo_file_is_put_aside_and_said(bench: Bench, crashed: Path, tmp_path: Path) -> None:
    crashed.write_text("[{")
    with serving(config(tmp_path)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        client.call("parameter.write", changes={"gait.step_length": 0.44})
    assert journal(tmp_path)[0]["what"] == "undo file damaged"
    assert list(crashed.parent.glob("undo.json.broken-*"))


def test_nothing_is_written_where_it_cannot_be_recorded(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "state").write_text("a file where a folder should be")
    with serving(config(tmp_path)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        error = client.refused("parameter.write", changes={"gait.step_length": 0.44})
        assert error.kind == "unavailable"
        assert "records" in str(error)
        assert bench.gait.node.written() == []
        assert client.call("robot.stop", reason="all the same")["drives"]["left_knee"] == "confirmed"
        assert client.call("robot.describe")["records"]["problem"] is not None


def test_the_journal_tells_what_happened_to_a_write(writer: Client, bench: Bench, tmp_path: Path) -> None:
    writer.call("parameter.write", changes={"gait.step_length": 0.42})
    writer.refused("parameter.write", changes={"gait.step_length": 0.59})
    bench.gait.node.store = lambda index, data: data if index != 0x2002 else b"\0\0"
    assert (
        writer.refused("parameter.write", changes={"gait.step_length": 0.44, "gait.cycle_time": 1.25}).kind
        == "rollback_failed"
    )
    told = [(one["what"], one["after"]) for one in journal(tmp_path) if "after" in one]
    assert told == [
        ("write", {"gait.step_length": 0.42}),
        ("write done", {"gait.step_length": 0.42}),
        ("write refused", {"gait.step_length": 0.59}),
        ("write", {"gait.step_length": 0.44, "gait.cycle_time": 1.25}),
    ]
    failed = next(one for one in journal(tmp_path) if one["what"] == "ROLL-BACK FAILED")
    assert failed["outcome"]["gait.step_length"] == "taken back"
    assert failed["outcome"]["gait.cycle_time"].startswith("unknown")
    assert held(bench) == 420
