"""Error control of a device: heartbeat, node guarding, and what missing them does (CiA 301 §7.2.8.3)."""

from pathlib import Path

import pytest

from tests.unit.hil_sim.bench import NODE, Bench, DeviceBench
from tests.unit.hil_sim.device_file import communication

EMCY, ERROR_CONTROL = 0x80 + NODE, 0x700 + NODE
LOST = bytes.fromhex("30 81 11")


@pytest.fixture
def device(tmp_path: Path) -> DeviceBench:
    bench = DeviceBench(communication().write(tmp_path))
    bench.boot()
    bench.send(0x000, "01 00")
    return bench


def watch(device: DeviceBench, entry: int, node: int, time_ms: int) -> str:
    return device.write(0x1016, entry, node << 16 | time_ms, 4)


def state(device: DeviceBench) -> int:
    """By node guarding."""
    (answer,) = device.ask(ERROR_CONTROL)
    return answer[0] & 0x7F


# -- producer --------------------------------------------------------------------------------------------


def test_a_heartbeat_begins_when_its_time_is_written(device: DeviceBench) -> None:
    device.heard.clear()
    device.write(0x1017, 0, 40, 2)
    assert device.of(ERROR_CONTROL) == [b"\x05"]
    device.run(100)
    assert len(device.of(ERROR_CONTROL)) == 3
    device.write(0x1017, 0, 0, 2)
    device.run(100)
    assert len(device.of(ERROR_CONTROL)) == 3


# -- consumer --------------------------------------------------------------------------------------------


def test_watching_begins_with_the_first_heartbeat(device: DeviceBench) -> None:
    assert watch(device, 1, 16, 100) == "ok"
    device.run(500)
    device.send(0x710, "00")  # a boot-up message is none
    device.run(500)
    assert device.of(EMCY) == []
    device.send(0x710, "05")
    device.run(95)
    assert device.of(EMCY) == []
    device.run(10)
    assert device.of(EMCY) == [LOST + b"\x10" + bytes(4)]


def test_each_entry_watches_its_own_node(device: DeviceBench) -> None:
    watch(device, 1, 16, 100)
    watch(device, 3, 17, 200)
    for _ in range(10):
        device.send(0x710, "05")
        device.send(0x711, "7F")
        device.run(80)
    assert device.of(EMCY) == []
    for _ in range(3):
        device.send(0x710, "05")
        device.run(90)
    assert [data[3] for data in device.of(EMCY)] == [17]


def test_a_heartbeat_that_comes_back_ends_the_error_and_is_watched_again(device: DeviceBench) -> None:
    watch(device, 1, 16, 100)
    device.send(0x710, "05")
    device.run(150)
    device.send(0x710, "05")
    assert device.of(EMCY)[1:] == [bytes(8)]
    assert device.read(0x1001) == 0
    device.run(150)
    assert len(device.of(EMCY)) == 3


def test_a_node_that_is_watched_no_more_is_missed_no_more(device: DeviceBench) -> None:
    watch(device, 1, 16, 100)
    device.send(0x710, "05")
    device.run(150)
    assert watch(device, 1, 16, 0) == "ok"
    assert device.of(EMCY)[1:] == [bytes(8)]
    assert device.read(0x1001) == 0


def test_a_remote_frame_to_another_node_is_no_heartbeat(device: DeviceBench) -> None:
    watch(device, 1, 16, 100)
    device.ask(0x710)
    device.run(500)
    assert device.of(EMCY) == []


def test_a_node_is_watched_once(device: DeviceBench) -> None:
    assert watch(device, 1, 16, 100) == "ok"
    assert watch(device, 2, 16, 200) == "06040043"
    assert watch(device, 2, 16, 0) == "ok"
    assert watch(device, 1, 16, 50) == "ok"
    assert watch(device, 1, 0, 0) == "ok"
    assert watch(device, 2, 16, 200) == "ok"


def test_another_time_counts_from_the_next_heartbeat(device: DeviceBench) -> None:
    watch(device, 1, 16, 100)
    device.send(0x710, "05")
    watch(device, 1, 16, 0)
    device.run(500)
    assert device.of(EMCY) == []
    watch(device, 1, 16, 50)
    device.run(500)
    assert device.of(EMCY) == []


@pytest.mark.parametrize(("behaviour", "after"), [(0, 127), (1, 5), (2, 4), (3, 5)])
def test_1029h_says_what_an_operational_device_enters(
    device: DeviceBench, behaviour: int, after: int
) -> None:
    device.write(0x1029, 1, behaviour, 1)
    watch(device, 1, 16, 100)
    device.send(0x710, "05")
    device.run(150)
    assert len(device.of(EMCY)) == 1  # also where it stops
    assert state(device) == after


def test_a_device_that_is_not_operational_stays_where_it_is(device: DeviceBench) -> None:
    device.send(0x000, "80 00")
    device.write(0x1029, 1, 2, 1)
    watch(device, 1, 16, 100)
    device.send(0x710, "05")
    device.run(150)
    assert state(device) == 127


def test_a_reset_forgets_what_was_watched(device: DeviceBench) -> None:
    watch(device, 1, 16, 100)
    device.send(0x710, "05")
    device.run(150)
    device.send(0x000, "82 00")
    device.run(200)
    assert device.read(0x1001) == 0
    device.send(0x710, "05")
    device.run(500)
    assert len(device.of(EMCY)) == 1


def test_a_drive_that_misses_a_heartbeat_reacts_as_6007h_says(bench: Bench) -> None:
    bench.start()
    bench.enable()
    bench.write(0x6007, 0, 2, 2)  # disable voltage
    bench.write(0x1016, 1, 0x0010_0064, 4)
    bench.send(0x710, "05")
    bench.run(200)
    assert bench.of(EMCY)[0][:2] == b"\x30\x81"
    assert bench.read(0x6041) & 0x4F == 0x40
    bench.run(100)
    assert bench.of(ERROR_CONTROL)[-1] == b"\x7f"


# -- node guarding ---------------------------------------------------------------------------------------


def test_guard_answers_toggle_from_zero(device: DeviceBench) -> None:
    assert [device.ask(ERROR_CONTROL) for _ in range(3)] == [[b"\x05"], [b"\x85"], [b"\x05"]]
    device.send(0x000, "02 00")
    assert device.ask(ERROR_CONTROL) == [b"\x84"]
    device.send(0x000, "82 00")
    device.run(60)
    assert device.ask(ERROR_CONTROL) == [b"\x7f"]


def test_a_device_with_a_heartbeat_is_not_guarded_as_well(device: DeviceBench) -> None:
    device.write(0x1017, 0, 10_000, 2)
    assert device.ask(ERROR_CONTROL) == []


def test_a_device_without_guarding_does_not_answer(tmp_path: Path) -> None:
    bench = DeviceBench(communication().write(tmp_path))
    text = (tmp_path / "device.eds").read_text(encoding="utf-8").replace("[100D]", "[100F]")
    (tmp_path / "device.eds").write_text(text, encoding="utf-8")
    bench = DeviceBench(tmp_path / "device.eds")
    bench.boot()
    assert bench.ask(ERROR_CONTROL) == []


def guarded(device: DeviceBench) -> None:
    device.write(0x100C, 0, 50, 2)
    assert device.write(0x100D, 0, 3, 1) == "ok"


def test_a_master_that_stops_guarding_is_missed(device: DeviceBench) -> None:
    guarded(device)
    device.run(500)
    assert device.of(EMCY) == []  # watching begins with the first request
    for _ in range(5):
        device.ask(ERROR_CONTROL)
        device.run(130)
    assert device.of(EMCY) == []
    device.run(30)
    assert device.of(EMCY) == [LOST + bytes(5)]
    assert state(device) == 127
    assert device.of(EMCY)[1:] == [bytes(8)]
    device.run(200)
    assert len(device.of(EMCY)) == 3


def test_without_a_life_time_nobody_is_missed(device: DeviceBench) -> None:
    device.write(0x100C, 0, 50, 2)
    device.ask(ERROR_CONTROL)
    device.run(5000)
    assert device.of(EMCY) == []
