"""Objects of every data type, access and limit, as an SDO client meets them (CiA 301 §7.1, §7.4.7)."""

from pathlib import Path

import pytest

from hil_sim.node.abort import SdoAbort
from hil_sim.node.coding import decode, encode
from tests.unit.hil_sim import device_file as types
from tests.unit.hil_sim.bench import DeviceBench
from tests.unit.hil_sim.device_file import DeviceFile


def device(tmp_path: Path, file: DeviceFile) -> DeviceBench:
    bench = DeviceBench(file.write(tmp_path))
    bench.boot()
    return bench


@pytest.mark.parametrize(
    ("data_type", "default", "on_the_wire"),
    [
        (types.BOOLEAN, 1, "01"),
        (types.INTEGER8, -2, "FE"),
        (types.UNSIGNED16, 0x1234, "34 12"),
        (types.INTEGER24, -2, "FE FF FF"),
        (types.INTEGER32, -2, "FE FF FF FF"),
        (types.UNSIGNED64, 0x8877665544332211, "11 22 33 44 55 66 77 88"),
        (types.INTEGER64, -2, "FE FF FF FF FF FF FF FF"),
        (types.REAL32, 1.5, "00 00 C0 3F"),
        (types.REAL64, 1.5, "00 00 00 00 00 00 F8 3F"),
        (types.VISIBLE_STRING, "Gelenk für links", "47 65 6C 65 6E 6B 20 66 FC 72 20 6C 69 6E 6B 73"),
        (types.UNICODE_STRING, "Ωß", "A9 03 DF 00"),
        (types.OCTET_STRING, "00 01 FE", "00 01 FE"),
        (types.DOMAIN, "0001FE", "00 01 FE"),
        (types.TIME_OF_DAY, "", "00 00 00 00 00 00"),
    ],
)
def test_defaults_of_every_type(tmp_path: Path, data_type: int, default: object, on_the_wire: str) -> None:
    bench = device(tmp_path, DeviceFile().add(0x2000, None, data_type, default))
    data = bytes.fromhex(on_the_wire)
    assert bench.node.dictionary.read(0x2000, 0) == data
    answer = bytes.fromhex(bench.sdo("40 00 20 00 00 00 00 00") or "")
    if len(data) <= 4:
        assert answer == bytes([0x43 | (4 - len(data)) << 2, 0x00, 0x20, 0x00]) + data.ljust(4, b"\0")
    else:
        assert answer == bytes([0x41, 0x00, 0x20, 0x00]) + len(data).to_bytes(4, "little")


def test_an_empty_string_is_a_segment_of_nothing(tmp_path: Path) -> None:
    bench = device(tmp_path, DeviceFile().add(0x2000, None, types.VISIBLE_STRING))
    assert bench.sdo("40 00 20 00 00 00 00 00") == "41 00 20 00 00 00 00 00"
    assert bench.sdo("60 00 00 00 00 00 00 00") == "0F 00 00 00 00 00 00 00"


@pytest.mark.parametrize(
    ("data_type", "low", "high", "value", "answer"),
    [
        (types.INTEGER8, -5, 5, "FA", "06090032"),
        (types.INTEGER8, -5, 5, "FB", "ok"),
        (types.INTEGER8, -5, 5, "06", "06090031"),
        (types.INTEGER16, "0xFFFB", 5, "FB FF", "ok"),  # as vendors write −5
        (types.INTEGER16, "0xFFFB", 5, "FA FF", "06090032"),
        (types.UNSIGNED32, 10, 20, "09 00 00 00", "06090032"),
        (types.UNSIGNED32, 10, 20, "14 00 00 00", "ok"),
        (types.UNSIGNED24, 10, 20, "15 00 00", "06090031"),
        (types.REAL32, 0.5, 1.5, "00 00 C0 3F", "ok"),
        (types.REAL32, 0.5, 1.5, "01 00 C0 3F", "06090031"),
        (types.BOOLEAN, 0, 1, "02", "06090031"),
        (types.BOOLEAN, 0, 1, "01", "ok"),
    ],
)
def test_limits_of_the_file_count(
    tmp_path: Path, data_type: int, low: object, high: object, value: str, answer: str
) -> None:
    bench = device(tmp_path, DeviceFile().add(0x2000, None, data_type, low, low=low, high=high))
    data = bytes.fromhex(value)
    got = bench.sdo(f"{0x23 | (4 - len(data)) << 2:02X} 00 20 00 {data.ljust(4, bytes(1)).hex()}") or ""
    codes = {"60": "ok", "80": bytes.fromhex(got)[:3:-1].hex()}
    assert codes[got[:2]] == answer
    assert (bench.node.dictionary.read(0x2000, 0) == data) is (answer == "ok")


@pytest.mark.parametrize(
    ("access", "read", "write"),
    [
        ("ro", "ok", "06010002"),
        ("const", "ok", "06010002"),
        ("wo", "06010001", "ok"),
        ("rw", "ok", "ok"),
        ("rwr", "ok", "ok"),
        ("rww", "ok", "ok"),
    ],
)
def test_access(tmp_path: Path, access: str, read: str, write: str) -> None:
    bench = device(tmp_path, DeviceFile().add(0x2000, None, types.UNSIGNED8, 1, access))
    got = bytes.fromhex(bench.sdo("40 00 20 00 00 00 00 00") or "")
    assert (got[:3:-1].hex() if got[0] == 0x80 else "ok") == read
    assert bench.write(0x2000, 0, 1, 1) == write


def test_what_does_not_exist(tmp_path: Path) -> None:
    bench = device(tmp_path, DeviceFile().add(0x2000, 0, types.UNSIGNED8, 1).add(0x2000, 2, types.UNSIGNED8))
    assert bench.write(0x2001, 0, 1, 1) == "06020000"
    assert bench.write(0x2000, 1, 1, 1) == "06090011"
    assert bench.write(0x2000, 2, 1, 1) == "ok"


def test_a_device_that_describes_no_communication_has_the_default_channel(tmp_path: Path) -> None:
    bench = device(tmp_path, DeviceFile().add(0x2000, None, types.UNSIGNED8, 9))
    assert bench.of(0x705) == [b"\0"]
    assert bench.read(0x2000) == 9
    bench.node.emergency(0x1000)
    bench.run(1000)
    assert len(bench.heard) == 2  # boot-up and answer; no EMCY without 1014h


@pytest.mark.parametrize("value", [-(1 << 40), -1, 0, 1, (1 << 40)])
def test_what_is_beyond_its_type_is_shown_as_its_end(tmp_path: Path, value: int) -> None:
    bench = device(tmp_path, DeviceFile().add(0x2000, None, types.INTEGER16))
    entry = bench.node.dictionary[0x2000, 0]
    entry.source = lambda: value
    shown = decode(entry.data_type, encode(entry.data_type, entry.get()))
    assert shown == min(max(value, -(1 << 15)), (1 << 15) - 1)


def test_a_name_where_a_number_is_needed_is_a_mistake_of_the_caller(tmp_path: Path) -> None:
    bench = device(tmp_path, DeviceFile().add(0x2000, None, types.VISIBLE_STRING, "x"))
    with pytest.raises(TypeError, match="2000h:0"):
        bench.node.dictionary.number((0x2000, 0))
    with pytest.raises(SdoAbort):
        bench.node.dictionary.find(0x2000, 1)
