"""Storing and restoring parameters: 1010h, 1011h, and the memory behind them (CiA 301 §7.5.2.13)."""

from pathlib import Path

import pytest

from hil_sim.errors import SimulatorError
from hil_sim.node.memory import FileMemory
from tests.unit.hil_sim.bench import NODE, DeviceBench
from tests.unit.hil_sim.device_file import REAL32, UNSIGNED16, UNSIGNED64, VISIBLE_STRING, communication

SAVE, LOAD = int.from_bytes(b"save", "little"), int.from_bytes(b"load", "little")
COMMUNICATION, MANUFACTURER, APPLICATION = 0x1017, 0x2000, 0x6000


def file(folder: Path) -> Path:
    described = communication()
    described.add(MANUFACTURER, None, UNSIGNED16, 1).add(APPLICATION, None, UNSIGNED16, 1, value=5)
    described.add(0x2001, None, VISIBLE_STRING, "name").add(0x2002, None, UNSIGNED64, 1)
    described.add(0x2003, None, REAL32, 0.5).add(0x2004, None, UNSIGNED16, 1, "wo")
    return described.write(folder, "device.dcf")


def bench(folder: Path) -> DeviceBench:
    device = DeviceBench(file(folder))
    device.node.storage.memory = FileMemory(folder / "memory" / "device.json", "device.dcf")
    device.boot()
    return device


@pytest.fixture
def device(tmp_path: Path) -> DeviceBench:
    return bench(tmp_path)


def change(device: DeviceBench, value: int) -> None:
    for index in (COMMUNICATION, MANUFACTURER, APPLICATION):
        assert device.write(index, 0, value, 2) == "ok"


def values(device: DeviceBench) -> list[int]:
    return [device.read(index) for index in (COMMUNICATION, MANUFACTURER, APPLICATION)]


def reset(device: DeviceBench, service: str = "81") -> None:
    device.send(0x000, f"{service} {NODE:02X}")
    device.run(60)


def test_a_device_begins_as_its_dcf_has_commissioned_it(device: DeviceBench) -> None:
    assert values(device) == [0, 1, 5]


@pytest.mark.parametrize(
    ("subindex", "kept"), [(1, [300, 300, 300]), (2, [300, 1, 5]), (3, [0, 1, 300]), (4, [0, 300, 5])]
)
def test_each_sub_index_stores_its_group(device: DeviceBench, subindex: int, kept: list[int]) -> None:
    change(device, 300)
    assert device.write(0x1010, subindex, SAVE, 4) == "ok"
    reset(device)
    assert values(device) == kept


@pytest.mark.parametrize(
    ("subindex", "kept"), [(1, [0, 1, 1]), (2, [0, 300, 300]), (3, [300, 300, 1]), (4, [300, 1, 300])]
)
def test_each_sub_index_restores_its_group_with_the_next_reset(
    device: DeviceBench, subindex: int, kept: list[int]
) -> None:
    change(device, 300)
    device.write(0x1010, 1, SAVE, 4)
    assert device.write(0x1011, subindex, LOAD, 4) == "ok"
    assert values(device) == [300, 300, 300]
    reset(device)
    assert values(device) == kept


def test_reset_communication_brings_back_communication_parameters_alone(device: DeviceBench) -> None:
    change(device, 300)
    device.write(0x1010, 2, SAVE, 4)
    change(device, 400)
    reset(device, "82")
    assert values(device) == [300, 400, 400]


@pytest.mark.parametrize("index", [0x1010, 0x1011])
def test_nothing_is_done_without_the_signature(device: DeviceBench, index: int) -> None:
    change(device, 300)
    for signature in (0, 1, LOAD if index == 0x1010 else SAVE, 0x12345678):
        assert device.write(index, 1, signature, 4) == "08000020"
    reset(device)
    assert values(device) == [0, 1, 5]


@pytest.mark.parametrize("index", [0x1010, 0x1011])
def test_both_objects_tell_what_the_device_can(device: DeviceBench, index: int) -> None:
    device.write(index, 1, SAVE if index == 0x1010 else LOAD, 4)
    assert [device.read(index, number) for number in range(5)] == [4, 1, 1, 1, 1]


def test_values_outlive_the_simulator(tmp_path: Path) -> None:
    first = bench(tmp_path)
    change(first, 300)
    first.sdo("21 02 20 00 08 00 00 00")
    first.sdo("00 01 02 03 04 05 06 07")
    first.sdo("1D 88 00 00 00 00 00 00")
    first.sdo("21 01 20 00 05 00 00 00")
    first.sdo("05 46 69 6E 6E 21 00 00")
    first.write(0x2003, 0, 0x3FC00000, 4)
    assert first.write(0x1010, 1, SAVE, 4) == "ok"
    second = bench(tmp_path)
    assert values(second) == [300, 300, 300]
    objects = second.node.dictionary
    assert objects[0x2001, 0].value == "Finn!"
    assert objects[0x2002, 0].value == 0x8807060504030201
    assert objects[0x2003, 0].value == 1.5
    assert second.write(0x1011, 1, LOAD, 4) == "ok"
    assert values(bench(tmp_path)) == [0, 1, 1]


def test_a_new_file_takes_the_place_of_the_old_one_at_once(tmp_path: Path) -> None:
    device = bench(tmp_path)
    device.write(0x1010, 1, SAVE, 4)
    path = tmp_path / "memory" / "device.json"
    before = path.read_text(encoding="utf-8")
    with path.open(encoding="utf-8") as reader:  # whoever has the old one open, has it whole
        change(device, 300)
        device.write(0x1010, 1, SAVE, 4)
        assert reader.read() == before != path.read_text(encoding="utf-8")
    assert [file.name for file in path.parent.iterdir()] == ["device.json"]


def test_another_device_begins_with_its_own_defaults(tmp_path: Path) -> None:
    first = bench(tmp_path)
    change(first, 300)
    first.write(0x1010, 1, SAVE, 4)
    other = DeviceBench(file(tmp_path))
    other.node.storage.memory = FileMemory(tmp_path / "memory" / "device.json", "other.eds")
    other.boot()
    assert values(other) == [0, 1, 5]


def test_what_no_longer_fits_the_description_is_left_out(tmp_path: Path) -> None:
    memory = FileMemory(tmp_path / "memory.json", "device.dcf")
    memory.save({(MANUFACTURER, 0): b"\x07", (APPLICATION, 0): b"\x07\x00", (0x5FFF, 0): b"\x01"})
    device = DeviceBench(file(tmp_path))
    device.node.storage.memory = memory
    device.boot()
    assert values(device) == [0, 1, 7]


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"device": "device.dcf"}', '{"device": "device.dcf", "objects": {"x": 1}}']
)
def test_a_broken_file_is_named_with_what_to_do(tmp_path: Path, text: str) -> None:
    path = tmp_path / "memory.json"
    path.write_text(text, encoding="utf-8")
    device = DeviceBench(file(tmp_path))
    device.node.storage.memory = FileMemory(path, "device.dcf")
    with pytest.raises(SimulatorError, match=r"memory\.json .* delete it"):
        device.node.power_on()


def test_a_device_that_cannot_store_says_so(tmp_path: Path) -> None:
    device = bench(tmp_path)
    (tmp_path / "memory").write_text("in the way", encoding="utf-8")
    change(device, 300)
    assert device.write(0x1010, 1, SAVE, 4) == "06060000"
    assert values(device) == [300, 300, 300]


def test_a_save_that_is_cut_off_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    device = bench(tmp_path)
    change(device, 300)
    device.write(0x1010, 1, SAVE, 4)

    def fail(_descriptor: int) -> None:
        raise OSError("the power is gone")

    monkeypatch.setattr("os.fsync", fail)
    change(device, 400)
    assert device.write(0x1010, 1, SAVE, 4) == "06060000"
    monkeypatch.undo()
    assert values(bench(tmp_path)) == [300, 300, 300]
