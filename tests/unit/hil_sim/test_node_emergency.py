"""Emergencies: message, 1001h, 1003h, 1014h, 1015h (CiA 301 §7.2.7, §7.5.2.2, §7.5.2.4)."""

from pathlib import Path

import pytest

from tests.unit.hil_sim.bench import NODE, Bench, DeviceBench
from tests.unit.hil_sim.device_file import communication

EMCY = 0x80 + NODE


@pytest.fixture
def device(tmp_path: Path) -> DeviceBench:
    bench = DeviceBench(communication().write(tmp_path))
    bench.boot()
    return bench


def test_an_error_makes_an_emergency_a_register_bit_and_a_history(bench: Bench) -> None:
    bench.boot()
    bench.drive.fault(0x4310)
    bench.run(2)
    assert bench.of(0x80 + NODE) == [bytes.fromhex("10 43 09 00 00 00 00 00")]
    assert bench.read(0x1001) == 0x09
    assert bench.read(0x1003) == 1
    assert bench.read(0x1003, 1) == 0x4310
    assert bench.read(0x603F) == 0x4310
    assert bench.read(0x6041) & 0x4F == 0x08
    bench.controlword(0x80)
    assert bench.of(0x80 + NODE)[-1] == bytes(8)
    assert bench.read(0x1001) == 0
    assert bench.read(0x1003) == 1  # what was, stays known


@pytest.mark.parametrize(
    ("code", "register"),
    [
        (0x1000, 0x01),
        (0x2310, 0x03),
        (0x3210, 0x05),
        (0x4210, 0x09),
        (0x5100, 0x01),
        (0x8130, 0x11),
        (0x8210, 0x11),
        (0x8611, 0x21),
        (0xFF01, 0x81),
    ],
)
def test_each_class_of_errors_has_its_bit(device: DeviceBench, code: int, register: int) -> None:
    device.node.emergency(code, b"\x01\x02")
    device.run(1)
    assert device.of(EMCY) == [code.to_bytes(2, "little") + bytes([register, 1, 2, 0, 0, 0])]
    assert device.read(0x1001) == register


def test_the_register_shows_what_is_left(device: DeviceBench) -> None:
    device.node.emergency(0x2310)
    device.node.emergency(0x3210)
    device.node.emergency(0x2310)  # it is there already
    device.node.emergency_over()
    device.run(2)
    assert [(data[:2].hex(), data[2]) for data in device.of(EMCY)] == [
        ("1023", 0x03),
        ("1032", 0x07),
        ("0000", 0x05),
        ("0000", 0x00),
    ]


def test_the_history_has_the_newest_first_and_forgets_the_oldest(device: DeviceBench) -> None:
    for code in (0x1000, 0x2310, 0x3210, 0x4210):
        device.node.emergency(code)
    device.run(2)
    assert device.read(0x1003) == 3
    assert [device.read(0x1003, number) for number in (1, 2, 3)] == [0x4210, 0x3210, 0x2310]


def test_an_empty_place_of_the_history_has_no_data(device: DeviceBench) -> None:
    assert device.read(0x1003) == 0
    assert device.sdo("40 03 10 01 00 00 00 00") == "80 03 10 01 24 00 00 08"


def test_only_zero_clears_the_history(device: DeviceBench) -> None:
    device.node.emergency(0x1000)
    assert device.write(0x1003, 0, 1, 1) == "06090030"
    assert device.write(0x1003, 1, 0, 4) == "06010002"
    assert device.read(0x1003) == 1
    assert device.write(0x1003, 0, 0, 1) == "ok"
    assert device.read(0x1003) == 0
    assert device.read(0x1001) == 0x01  # the error is still there


def test_the_history_is_gone_with_the_power(device: DeviceBench) -> None:
    device.node.emergency(0x1000)
    device.send(0x000, "81 00")
    device.run(60)
    assert device.read(0x1003) == 1
    device.node.power_off()
    device.boot()
    assert device.read(0x1003) == 0


def test_the_inhibit_time_lies_between_two_messages(device: DeviceBench) -> None:
    device.write(0x1015, 0, 500, 2)  # 50 ms
    for code in (0x1000, 0x2310, 0x3210):
        device.node.emergency(code)
    device.run(200)
    heard = [heard for heard in device.heard if heard.cob_id == EMCY]
    assert [heard.data[1] for heard in heard] == [0x10, 0x23, 0x32]
    assert [round(later.at_ms - heard[0].at_ms) for later in heard] == [0, 50, 100]


def test_a_disabled_emcy_is_not_sent_but_remembered(device: DeviceBench) -> None:
    assert device.write(0x1014, 0, 0x8000_0000 | EMCY, 4) == "ok"
    device.node.emergency(0x1000)
    device.run(10)
    assert device.of(EMCY) == []
    assert device.read(0x1003) == 1


def test_the_identifier_changes_while_emcy_is_disabled(device: DeviceBench) -> None:
    assert device.write(0x1014, 0, 0x0C0, 4) == "06090030"
    assert device.write(0x1014, 0, 0x8000_00C0, 4) == "ok"
    assert device.write(0x1014, 0, 0x0C0, 4) == "ok"
    device.node.emergency(0x1000)
    device.run(10)
    assert len(device.of(0x0C0)) == 1


def test_a_stopped_device_sends_none(device: DeviceBench) -> None:
    device.send(0x000, "02 00")
    device.node.emergency(0x1000)
    device.run(10)
    device.send(0x000, "80 00")
    device.run(100)
    assert device.of(EMCY) == []
    assert device.read(0x1001) == 0x01
