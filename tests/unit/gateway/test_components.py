"""Snapshots and descriptions: values, stamps and quality; what is missing is null and named."""

import math
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.component import ComponentKind
from drivers.samples import ComponentState, Finding, Quality
from gateway.modules.component.assembly import assemble
from tests.support.waiting import until
from tests.unit.gateway.harness import ROBOT, Bench, Client, config, serving


def test_a_snapshot_has_value_stamp_and_quality_of_every_channel(client: Client, bench: Bench) -> None:
    answer = client.call("component.snapshot")
    assert answer["values"] == {
        "left_knee.position": 0.5,
        "left_knee.statusword": 0x1237,
        "right_knee.position": 0.5,
        "right_knee.statusword": 0x1237,
        "left_insole.force": 300.0,
        "left_insole.cop_x": None,
    }
    assert set(answer["stamps_ns"]) == set(answer["values"])
    assert set(answer["quality"]) == {"left_knee", "right_knee", "gait", "left_insole"}
    assert answer["quality"]["left_knee"]["state"] == "ok"
    assert answer["quality"]["left_knee"]["frames"] == 7
    assert answer["quality"]["left_knee"]["age_ms"] >= 0


def test_globs_choose_channels(client: Client) -> None:
    answer = client.call("component.snapshot", channels=["*_knee.position", "left_insole.f*"])
    assert set(answer["values"]) == {"left_knee.position", "right_knee.position", "left_insole.force"}
    assert set(answer["quality"]) == {"left_knee", "right_knee", "left_insole"}


def test_a_glob_that_means_nothing_is_an_unknown_name(client: Client) -> None:
    error = client.refused("component.snapshot", channels=["left_knee.position", "left_nee.*"])
    assert error.kind == "unknown_name"
    assert "'left_nee.*'" in str(error)


def test_a_stale_value_is_null_and_keeps_its_stamp(client: Client, bench: Bench) -> None:
    stamp_ns = time.monotonic_ns() - 2_000_000_000_000
    client.call("component.snapshot")
    bench.insole.give(1.0, 2.0, stamp_ns=stamp_ns)
    answer = client.call("component.snapshot", channels=["left_insole.force"])
    assert answer["values"] == {"left_insole.force": None}
    assert answer["stamps_ns"] == {"left_insole.force": stamp_ns}


def test_a_value_that_is_no_number_is_null(client: Client, bench: Bench) -> None:
    client.call("component.snapshot")
    bench.insole.give(math.nan, math.inf)
    assert set(client.call("component.snapshot", channels=["left_insole.*"])["values"].values()) == {None}


def test_a_cold_start_waits_for_the_first_values(
    connect: Callable[[], Client], bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.modules.component.module.COLD_S", 1000.0)
    bench.insole.latest.clear()
    slow, other = connect(), connect()
    id_ = slow.request("component.snapshot", channels=["left_insole.*"])
    assert other.call("component.snapshot", channels=["left_knee.*"])["values"]["left_knee.position"] == 0.5
    assert other.call("clock.read")  # nobody else waits
    bench.insole.give(12.0, 0.1)
    assert slow.answer(id_)["values"]["left_insole.force"] == 12.0


@pytest.mark.usefixtures("impatient")
def test_a_cold_start_does_not_wait_for_ever(client: Client, bench: Bench) -> None:
    bench.insole.latest.clear()
    answer = client.call("component.snapshot")
    assert answer["values"]["left_insole.force"] is None
    assert answer["values"]["left_knee.position"] == 0.5


def test_what_cannot_be_built_is_named_and_the_rest_is_served(client: Client, bench: Bench) -> None:
    bench.absent["left_knee"] = (ComponentKind.JOINT, "knee.eds: line 3: no such object")
    described = client.call("robot.describe")
    states = {one["name"]: (one["state"], one["problem"]) for one in described["components"]}
    assert states["left_knee"] == ("lost", "knee.eds: line 3: no such object")
    assert states["right_knee"] == ("ok", None)
    answer = client.call("component.snapshot")
    assert answer["quality"]["left_knee"]["problem"] == "knee.eds: line 3: no such object"
    assert answer["values"]["right_knee.position"] == 0.5
    error = client.refused("component.snapshot", channels=["left_knee.position"])
    assert (error.kind, error.data["component"]) == ("unavailable", "left_knee")
    assert "line 3" in str(error)
    error = client.refused("stream.start", modules=["component"], rate_hz=1, channels=["left_knee.*"])
    assert error.kind == "unavailable"


def test_a_component_that_is_not_there_stands_where_the_file_has_it(client: Client, bench: Bench) -> None:
    bench.absent["left_knee"] = (ComponentKind.JOINT, "knee.eds: line 3: no such object")
    in_the_file = ["left_knee", "right_knee", "gait", "left_insole"]
    assert [one["name"] for one in client.call("robot.describe")["components"]] == in_the_file
    assert list(client.call("component.snapshot")["quality"]) == in_the_file
    assert list(client.call("status.snapshot")["quality"]) == ["left_knee", "right_knee", "left_insole"]


def test_no_value_is_younger_than_the_snapshot_that_it_is_in(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    client.call("component.snapshot")
    latest = bench.insole.latest
    read = latest.read

    def comes_meanwhile(index: int, now_ns: int) -> tuple[float | None, int | None]:
        bench.insole.give(1.0, 2.0, stamp_ns=time.monotonic_ns())
        return read(index, now_ns)

    monkeypatch.setattr(latest, "read", comes_meanwhile)
    answer = client.call("component.snapshot", channels=["left_insole.*"])
    assert max(answer["stamps_ns"].values()) <= answer["stamp_ns"]


def test_a_component_that_cannot_start_does_not_stop_the_rest(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def start() -> None:
        raise RuntimeError("no threads left")

    monkeypatch.setattr(bench.insole, "start", start)
    answer = client.call("component.snapshot")
    assert "no threads left" in answer["quality"]["left_insole"]["problem"]
    assert answer["values"]["left_knee.position"] == 0.5


@pytest.mark.usefixtures("impatient")
def test_a_component_that_is_lost_says_why(client: Client, bench: Bench) -> None:
    bench.gait.lost = "no frame at all from node 16: check its power"
    described = client.call("robot.describe")
    gait = next(one for one in described["components"] if one["name"] == "gait")
    assert (gait["kind"], gait["state"]) == ("device", "lost")
    assert gait["problem"] == "no frame at all from node 16: check its power"


def test_the_joints_of_both_legs_are_judged_against_each_other(tmp_path: Path) -> None:
    joints: Any = assemble(config(tmp_path)).components
    assert joints["left_knee"]._watch.check.mirror is not None
    assert joints["right_knee"]._watch.check.mirror is not None


def test_what_was_found_is_told_with_its_beginning(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    finding = Finding(7, "it hangs", "check its power")
    found = Quality(ComponentState.FAULT, 1.0, "it hangs (for 2 s): check its power", findings=(finding,))
    monkeypatch.setattr(bench.insole, "quality", lambda _now_ns: found)
    parts = {one["name"]: one for one in client.call("robot.describe")["components"]}
    assert parts["left_insole"]["findings"] == [
        {"since_ns": 7, "words": "it hangs", "check": "check its power"}
    ]
    assert "findings" not in parts["left_knee"]
    assert "emcy" not in parts["left_knee"]


def test_the_last_emergency_message_is_told_also_when_it_is_over(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench.left.node, "description", SimpleNamespace(vendor_id=None), raising=False)
    client.call("robot.describe")
    bench.left.node.life.on_emcy(5, bytes.fromhex("1186 21 0000000000"))
    emcy = {
        "stamp_ns": 5,
        "code": 0x8611,
        "words": "0x8611 following error too large (register: generic, profile)",
    }
    (knee,) = (one for one in client.call("robot.describe")["components"] if one["name"] == "left_knee")
    assert knee["emcy"] == {**emcy, "active": True}
    bench.left.node.life.on_emcy(6, bytes(8))
    (knee,) = (one for one in client.call("robot.describe")["components"] if one["name"] == "left_knee")
    assert knee["emcy"] == {**emcy, "active": False}


def test_describe_tells_all_a_client_needs(client: Client) -> None:
    described = client.call("robot.describe")
    assert (described["robot"], described["role"]) == ("exo-test", "observer")
    channels = {one["name"]: one for one in described["channels"]}
    assert channels["left_knee.position"] == {
        "name": "left_knee.position",
        "unit": "rad",
        "component": "left_knee",
        "quantity": "position",
    }
    assert channels["resource.cpu_percent"]["unit"] == "%"
    parameters = {one["name"]: one for one in described["parameters"]}
    step = parameters["gait.step_length"]
    assert (step["unit"], step["min"], step["max"], step["max_step"]) == ("m", 0.25, 0.6, 0.1)
    assert (step["object"], step["access"], step["live"], step["component"]) == (
        "0x2001:0",
        "rw",
        True,
        "gait",
    )
    assert described["modules"]["control"] == "running"
    assert described["stop"]["held"] is False
    assert set(described["stop"]["drives"]) == {"left_knee", "right_knee"}
    assert described["guard"]["configured"] is False
    assert described["clock"]["boot_id"] == described["boot_id"]


def test_modules_start_with_the_first_client_and_stop_after_the_last(
    connect: Callable[[], Client], bench: Bench
) -> None:
    watcher = connect()
    assert bench.left.started == 0
    first, second = connect(), connect()
    first.call("component.snapshot")
    second.call("component.snapshot")
    assert (bench.left.started, bench.left.stopped, bench.assembled) == (1, 0, 1)
    first.close()
    time.sleep(0.15)  # longer than linger_s
    assert second.call("component.snapshot")["values"]["left_knee.position"] == 0.5
    assert bench.left.stopped == 0
    second.close()
    until(lambda: bench.left.stopped == 1, "the last client has left")
    assert watcher.call("component.snapshot", channels=["left_knee.*"])["values"]["left_knee.position"] == 0.5
    assert (bench.left.started, bench.assembled) == (2, 2)


def test_a_start_and_stop_that_take_long_hold_nobody_up(bench: Bench, tmp_path: Path) -> None:
    go, stopping = threading.Event(), threading.Event()
    starting, stop = bench.assemble, bench.left.stop

    def assemble_slowly(robot: object) -> object:
        go.wait()
        return starting(config(tmp_path, ROBOT))

    def stop_slowly() -> None:
        stopping.set()
        go.wait()
        stop()

    with pytest.MonkeyPatch.context() as patch, serving(config(tmp_path)) as address:
        patch.setattr("gateway.modules.component.module.assemble", assemble_slowly)
        patch.setattr(bench.left, "stop", stop_slowly)
        with Client(address) as slow, Client(address) as other:
            id_ = slow.request("component.snapshot", channels=["left_knee.position"])
            assert other.call("clock.read")
            assert other.call("resource.snapshot", processes=False)
            go.set()
            assert slow.answer(id_)["values"] == {"left_knee.position": 0.5}
            go.clear()
            slow.close()
            until(stopping.is_set, "it is stopping")
            id_ = other.request("component.snapshot", channels=["left_knee.position"])
            assert other.call("clock.read")
            go.set()
            assert other.answer(id_)["values"] == {"left_knee.position": 0.5}


def test_a_module_that_cannot_start_says_why_and_is_tried_again(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:

        def broken(_config: object) -> None:
            raise OSError("no memory")

        patch.setattr("gateway.modules.component.module.assemble", broken)
        for method in ("component.snapshot", "status.snapshot", "parameter.list", "robot.stop"):
            error = client.refused(method)
            assert error.kind == "unavailable"
            assert "component cannot start: no memory" in str(error)
    assert client.call("component.snapshot")["values"]["left_knee.position"] == 0.5


def test_status_is_a_small_choice_of_both_modules(client: Client) -> None:
    first = client.call("status.snapshot")
    assert set(first["values"]) == {
        "left_knee.position",
        "right_knee.position",
        "left_insole.force",
        "left_insole.cop_x",
        "resource.cpu_percent",
        "resource.memory_percent",
    }
    assert first["values"]["resource.cpu_percent"] is None
    assert 0 < first["values"]["resource.memory_percent"] < 100
    assert set(first["quality"]) >= {"left_knee", "left_insole"}
    until(
        lambda: client.call("status.snapshot")["values"]["resource.cpu_percent"] is not None, "cpu is known"
    )


def test_objects_that_the_file_makes_channels_are_channels_of_their_components(tmp_path: Path) -> None:
    more = (
        '[channel."gait.phase"]\nobject = "0x2011:0"\nscale = 0.001\n'
        '[channel."gait.state"]\nobject = "0x2010:0"\nwords = { 0 = "idle" }\n'
        '[channel."left_knee.temperature"]\nobject = "0x2011:0"\nunit = "°C"\nscale = 0.1\n'
    )
    components = assemble(config(tmp_path, ROBOT + more)).components
    assert [(one.name, one.enum) for one in components["gait"].channels] == [
        ("gait.phase", None),
        ("gait.state", {0: "idle"}),
    ]
    knee = [one.quantity for one in components["left_knee"].channels]
    assert knee[-2:] == ["state", "temperature"]
    assert knee.count("temperature") == 1
    assert "temperature" in [one.quantity for one in components["right_knee"].channels][:-1]
