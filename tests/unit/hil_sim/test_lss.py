"""LSS of simulated devices, frame by frame as CiA 305 has it: identities, node ids, bit rates, fastscan."""

from pathlib import Path

import pytest

import eds
from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.clock import MILLISECOND_NS, Clock
from hil_sim.exoskeleton import Exoskeleton
from hil_sim.node.lss import UNCONFIGURED
from hil_sim.node.memory import FileMemory
from hil_sim.node.node import Node
from tests.unit.hil_sim.bench import NODE, Bench
from tests.unit.hil_sim.device_file import UNSIGNED16, communication

REQUEST, ANSWER = 0x7E5, 0x7E4
IDENTITY = (0x123, 0x456, 0x10001)  # of `communication()`, whose serial number is given here
FIRST_SERIAL = 0xA0000001


class Line:
    """Devices of one product on a bus, with a listener."""

    def __init__(self, folder: Path, *node_ids: int, serials: tuple[int, ...] = ()) -> None:
        self.clock = Clock()
        self.bus = CanBus(self.clock)
        self.heard: list[tuple[int, bytes]] = []
        self.bus.attach(self, lambda frame, _sender: self.heard.append((frame.cob_id, frame.data)))
        file = communication().add(0x2000, None, UNSIGNED16, 7, mapping=True)
        file.pdo(0, False, "$NODEID+0x180", 255, 0x2000_0010)
        path = file.write(folder)
        self.nodes = [Node(self.clock, self.bus, f"{n}", 5, eds.load(path, 5)) for n in range(len(node_ids))]
        for number, (node, node_id) in enumerate(zip(self.nodes, node_ids, strict=True)):
            node.factory_node_id = node_id
            node.number_serially(serials[number] if serials else FIRST_SERIAL + number)
            node.power_on()
        self.run(100)

    def run(self, milliseconds: float) -> None:
        self.clock.run_until(self.clock.now_ns + round(milliseconds * MILLISECOND_NS))

    def send(self, cob_id: int, data: bytes) -> list[tuple[int, bytes]]:
        """Send a frame; all that comes within 2 ms."""
        before = len(self.heard)
        self.bus.send(Frame(cob_id, data), self)
        self.run(2)
        return self.heard[before:]

    def ask(self, command: int, *content: int) -> list[bytes]:
        """An LSS request; its answers."""
        data = bytes([command, *content]).ljust(8, b"\0")
        return [data for cob_id, data in self.send(REQUEST, data) if cob_id == ANSWER]

    def select(self, serial: int) -> list[bytes]:
        for part, number in enumerate((*IDENTITY, serial)):
            answers = self.ask(0x40 + part, *number.to_bytes(4, "little"))
        return answers

    def scan(self, number: int, bit: int, part: int, then: int) -> bool:
        return bool(self.ask(0x51, *number.to_bytes(4, "little"), bit, part, then))


def word(command: int, *content: int) -> bytes:
    return bytes([command, *content]).ljust(8, b"\0")


def test_a_device_without_a_node_id_says_nothing_and_hears_nothing_but_lss(tmp_path: Path) -> None:
    line = Line(tmp_path, UNCONFIGURED)
    assert line.heard == []
    line.send(0x000, b"\x01\x00")
    line.send(0x605, bytes.fromhex("40 00 10 00 00 00 00 00"))
    line.send(0x6FF, bytes.fromhex("40 00 10 00 00 00 00 00"))
    line.run(2000)
    assert line.heard == []
    assert line.ask(0x4C) == [word(0x50)]


def test_a_node_id_given_is_booted_with_and_its_identifiers_follow(tmp_path: Path) -> None:
    line = Line(tmp_path, UNCONFIGURED)
    assert line.ask(0x04, 1) == []
    assert line.ask(0x11, 42) == [word(0x11)]
    assert line.ask(0x5E) == [word(0x5E, UNCONFIGURED)], "it is pending, not active"
    line.run(500)
    assert (0x72A, b"\0") not in line.heard
    line.send(REQUEST, word(0x04, 0))
    line.run(60)
    assert line.heard[-1] == (0x72A, b"\0")
    assert line.send(0x62A, bytes.fromhex("40 00 18 01 00 00 00 00"))[-1] == (
        0x5AA,
        bytes.fromhex("43 00 18 01 AA 01 00 00"),
    )
    assert line.send(0x000, b"\x01\x2a")[-1] == (0x1AA, b"\x07\x00")


def test_another_node_id_waits_for_the_reset_of_communication(tmp_path: Path) -> None:
    line = Line(tmp_path, 5)
    line.select(FIRST_SERIAL)
    line.ask(0x11, 6)
    line.ask(0x04, 0)
    line.run(200)
    assert line.send(0x605, bytes.fromhex("40 00 10 00 00 00 00 00"))
    line.send(0x000, b"\x82\x05")
    line.run(60)
    assert line.heard[-1] == (0x706, b"\0")
    assert not [one for one in line.send(0x605, bytes.fromhex("40 00 10 00 00 00 00 00")) if one[0] == 0x585]


@pytest.mark.parametrize(("store", "after"), [(True, 6), (False, 5)])
def test_a_node_id_survives_the_power_only_where_it_was_stored(
    tmp_path: Path, store: bool, after: int
) -> None:
    line = Line(tmp_path, 5)
    node = line.nodes[0]
    node.storage.memory = FileMemory(tmp_path / "memory.json", "device.eds")
    line.select(FIRST_SERIAL)
    line.ask(0x11, 6)
    if store:
        assert line.ask(0x17) == [word(0x17)]
    line.send(0x000, b"\x81\x05")  # a reset of the node counts as power
    line.run(60)
    assert line.heard[-1] == (0x700 + after, b"\0")
    node.power_off()
    node.power_on()
    line.run(60)
    assert line.heard[-1] == (0x700 + after, b"\0")


def test_restoring_the_defaults_forgets_no_node_id(tmp_path: Path) -> None:
    line = Line(tmp_path, 5)
    line.select(FIRST_SERIAL)
    line.ask(0x11, 6)
    line.ask(0x17)
    line.ask(0x04, 0)
    line.send(0x605, bytes.fromhex("23 11 10 01 6C 6F 61 64"))
    line.send(0x000, b"\x81\x00")
    line.run(60)
    assert line.heard[-1] == (0x706, b"\0")


def test_a_device_tells_whose_it_is_to_who_has_selected_it(tmp_path: Path) -> None:
    line = Line(tmp_path, 5, 6)
    assert line.ask(0x5A) == []
    assert line.select(FIRST_SERIAL + 1) == [word(0x44)]
    numbers = (*IDENTITY, FIRST_SERIAL + 1)
    for part, number in enumerate(numbers):
        assert line.ask(0x5A + part) == [word(0x5A + part, *number.to_bytes(4, "little"))]
    assert line.ask(0x5E) == [word(0x5E, 6)]


def test_a_selection_out_of_order_selects_nobody(tmp_path: Path) -> None:
    line = Line(tmp_path, 5)
    for part in (0, 2, 1, 3):
        answers = line.ask(0x40 + part, *(*IDENTITY, FIRST_SERIAL)[part].to_bytes(4, "little"))
        assert answers == []
    assert line.ask(0x5E) == []


@pytest.mark.parametrize(
    ("low", "high", "found"), [(0, 0xFFFFFFFF, 2), (FIRST_SERIAL + 1, FIRST_SERIAL + 9, 1), (1, 2, 0)]
)
def test_devices_in_a_range_of_serial_numbers_say_so(tmp_path: Path, low: int, high: int, found: int) -> None:
    line = Line(tmp_path, 5, UNCONFIGURED)
    for place, number in enumerate((*IDENTITY[:2], IDENTITY[2], IDENTITY[2], low, high)):
        answers = line.ask(0x46 + place, *number.to_bytes(4, "little"))
    assert answers == [word(0x4F)] * found


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ((0x11, 0), (0x11, 1)),
        ((0x11, 128), (0x11, 1)),
        ((0x11, 127), (0x11, 0)),
        ((0x11, 255), (0x11, 0)),
        ((0x13, 0, 2), (0x13, 0)),
        ((0x13, 0, 5), (0x13, 1)),
        ((0x13, 0, 9), (0x13, 1)),
        ((0x13, 1, 0), (0x13, 1)),
        ((0x17,), (0x17, 0)),
    ],
)
def test_what_cannot_be_is_refused_by_its_code(
    tmp_path: Path, request_: tuple[int, ...], answer: tuple[int, ...]
) -> None:
    line = Line(tmp_path, 5)
    line.ask(0x04, 1)
    assert line.ask(*request_) == [word(*answer)]


def test_a_device_that_cannot_store_says_so(tmp_path: Path) -> None:
    line = Line(tmp_path, 5)
    line.nodes[0].lss.stores = False
    line.ask(0x04, 1)
    assert line.ask(0x17) == [word(0x17, 1)]
    line.nodes[0].lss.stores = True

    class Broken:
        def load(self) -> None:
            return None

        def save(self, _kept: object) -> None:
            raise OSError("worn out")

    line.nodes[0].storage.memory = Broken()
    assert line.ask(0x17) == [word(0x17, 2)]


def test_a_device_at_another_bit_rate_is_gone_until_the_bus_follows(tmp_path: Path) -> None:
    line = Line(tmp_path, 5)
    line.send(0x605, bytes.fromhex("2B 17 10 00 0A 00 00 00"))  # a heartbeat each 10 ms
    line.ask(0x04, 1)
    assert line.ask(0x13, 0, 2) == [word(0x13)]
    line.ask(0x15, 20, 0)
    assert line.ask(0x5E), "until the delay is over"
    line.run(25)
    line.heard.clear()
    assert line.ask(0x5E) == []
    line.run(50)
    assert line.heard == []
    line.bus.bitrate = 500_000
    assert line.ask(0x5E) == [word(0x5E, 5)]


def test_an_operational_device_leaves_lss_alone(tmp_path: Path) -> None:
    line = Line(tmp_path, 5)
    line.send(0x000, b"\x01\x05")
    line.ask(0x04, 1)
    assert line.ask(0x5E) == []
    line.send(0x000, b"\x02\x05")  # a stopped one answers
    line.ask(0x04, 1)
    assert line.ask(0x5E) == [word(0x5E, 5)]


def found_by_fastscan(line: Line) -> list[int] | None:
    """The binary search of CiA 305, as a master does it."""
    if not line.scan(0, 128, 0, 0):
        return None
    numbers = [0, 0, 0, 0]
    for part in range(4):
        for bit in range(31, -1, -1):
            if not line.scan(numbers[part], bit, part, part):
                numbers[part] |= 1 << bit
        assert line.scan(numbers[part], 0, part, (part + 1) % 4)
    return numbers


def test_fastscan_finds_one_unconfigured_device_after_the_other(tmp_path: Path) -> None:
    serials = (7, 0xFFFFFFFF, 0x80000000, 6)
    line = Line(tmp_path, UNCONFIGURED, UNCONFIGURED, 9, UNCONFIGURED, serials=serials)
    found = []
    for node_id in (11, 12, 13):
        numbers = found_by_fastscan(line)
        assert numbers is not None
        assert numbers[:3] == list(IDENTITY)
        found.append(numbers[3])
        line.ask(0x11, node_id)
        line.ask(0x04, 0)
        line.run(60)
    assert found == [6, 7, 0xFFFFFFFF], "the configured one takes no part"
    assert found_by_fastscan(line) is None
    assert [node.node_id for node in line.nodes] == [12, 13, 9, 11]


def test_a_scan_that_confirms_without_going_on_selects_nobody(tmp_path: Path) -> None:
    line = Line(tmp_path, UNCONFIGURED)
    line.scan(0, 128, 0, 0)
    assert line.scan(IDENTITY[0], 0, 0, 0)
    assert not line.scan(IDENTITY[1], 0, 1, 2), "it is still at the vendor"
    assert line.ask(0x5E) == []


@pytest.mark.parametrize("data", [b"", b"\x04\x01", bytes.fromhex("51 00 00 00 00 FF 09 09"), b"\xee" * 8])
def test_frames_that_are_no_requests_change_nothing(tmp_path: Path, data: bytes) -> None:
    line = Line(tmp_path, UNCONFIGURED)
    assert line.send(REQUEST, data) == []
    assert line.ask(0x5E) == []


def test_the_drives_of_the_robot_have_serial_numbers_and_come_unconfigured_on_request() -> None:
    robot = Exoskeleton(without=("gait",), unconfigured=("left_knee", "right_knee"))
    heard: list[Frame] = []
    robot.bus.attach("listener", lambda frame, _sender: heard.append(frame))
    robot.power_on()
    robot.clock.run_until(robot.clock.now_ns + 200 * MILLISECOND_NS)
    booted = {frame.cob_id for frame in heard if frame.data == b"\0" and frame.cob_id >= 0x700}
    assert booted == {0x701, 0x703, 0x704, 0x706}
    numbers = [drive.dictionary.number((0x1018, 4)) for drive in robot.drives.values()]
    assert len(set(numbers)) == 6
    assert 0 not in numbers


def test_a_drive_moves_as_before_under_its_new_node_id(bench: Bench) -> None:
    bench.boot()
    bench.send(REQUEST, "04 01 00 00 00 00 00 00")
    bench.send(REQUEST, "11 21 00 00 00 00 00 00")
    bench.send(REQUEST, "04 00 00 00 00 00 00 00")
    bench.send(0x000, f"82 {NODE:02X}")
    bench.run(60)
    bench.heard.clear()
    bench.send(0x621, "2B 40 60 00 06 00 00 00")
    bench.send(0x621, "40 41 60 00 00 00 00 00")
    assert bench.of(0x5A1)[-1][4] & 0x6F == 0x21
