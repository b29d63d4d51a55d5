"""An independent CANopen master before simulated devices: plain canopen and python-can scripts.

The devices run in half of real time, so that a machine that stalls does not run into their time-outs.
"""

import queue
import random
import struct
import threading
from collections.abc import Iterator
from pathlib import Path

import can
import canopen
import pytest
from canopen.objectdictionary import ODVariable

import eds
from eds.shipped import SHIPPED, shipped
from hil_sim.bus.can_bus import CanBus
from hil_sim.bus.virtual import VirtualBridge
from hil_sim.clock import Clock
from hil_sim.drive.drive import JointDrive
from hil_sim.drive.mechanics import Joint, JointConstants
from hil_sim.loop import Loop
from hil_sim.node.node import Node
from tests.support.waiting import WAIT_S, until
from tests.unit.hil_sim.device_file import DOMAIN, UNSIGNED16, UNSIGNED64, VISIBLE_STRING, communication

DEVICE, DRIVE = 5, 6
ABORTED = canopen.SdoAbortedError


class World:
    """A simulated bus that runs in a thread, and a master on the virtual channel that leads to it."""

    def __init__(self, channel: str) -> None:
        self.channel = channel
        self.clock = Clock()
        self.bus = CanBus(self.clock)
        self.loop = Loop(self.clock, speed=0.5)
        self.network = canopen.Network()
        self.network.NOTIFIER_CYCLE = 0.02  # s: how soon it ends
        self._bridge = VirtualBridge(self.bus, channel)
        self._thread = threading.Thread(target=self.loop.run, name="simulated devices")

    def run(self, node_id: int, file: Path) -> canopen.RemoteNode:
        """Let a device of this file boot, a drive if it has a controlword; canopen's view of it."""
        description = eds.load(file, node_id)
        self._device(node_id, description).power_on()
        node = canopen.RemoteNode(node_id, eds.load(file, node_id).object_dictionary)
        self.network.connect(interface="virtual", channel=self.channel)
        self.network.add_node(node)
        node.sdo.RESPONSE_TIMEOUT = WAIT_S
        booted = boot_up(node)
        self._thread.start()
        assert booted.wait(WAIT_S)
        return node

    def _device(self, node_id: int, description: eds.Description) -> Node:
        if not description.has(0x6040):
            return Node(self.clock, self.bus, "device", node_id, description)
        joint = Joint(JointConstants(), 0.0)
        return JointDrive(self.clock, self.bus, "drive", node_id, description, joint)

    def close(self) -> None:
        self.network.disconnect()
        self.loop.stop()
        if self._thread.is_alive():
            self._thread.join()
        self._bridge.close()
        self.loop.close()


@pytest.fixture
def world(tmp_path: Path) -> Iterator[World]:
    world = World(str(tmp_path))
    yield world
    world.close()


@pytest.fixture
def device_file(tmp_path: Path) -> Path:
    file = communication().add(0x1008, None, VISIBLE_STRING, "A device that is nobody's", "const")
    file.add(0x2000, None, DOMAIN, "00").add(0x2001, None, UNSIGNED64, 1).add(
        0x2002, None, VISIBLE_STRING, ""
    )
    file.add(0x2010, None, UNSIGNED16, 0, mapping=True).add(0x2011, None, UNSIGNED16, 0, mapping=True)
    file.pdo(0, False, "$NODEID+0x180", 1, 0x2010_0010).pdo(0, True, "$NODEID+0x200", 255, 0x2011_0010)
    return file.write(tmp_path)


@pytest.fixture
def device(world: World, device_file: Path) -> canopen.RemoteNode:
    """A node with every communication object, and 2010h and 2011h in its PDOs."""
    return world.run(DEVICE, device_file)


@pytest.fixture
def drive(world: World) -> canopen.RemoteNode:
    return world.run(DRIVE, SHIPPED / "joint_drive.eds")


def boot_up(node: canopen.RemoteNode) -> threading.Event:
    """Set by the node's next boot-up message."""
    booted = threading.Event()
    node.nmt.add_heartbeat_callback(lambda state: booted.set() if state == 0 else None)
    return booted


def reset(node: canopen.RemoteNode, command: str = "RESET") -> None:
    booted = boot_up(node)
    node.nmt.state = command
    assert booted.wait(WAIT_S)


def emergency(node: canopen.RemoteNode, code: int) -> canopen.emcy.EmcyError:
    """The newest emergency, once it has this code."""
    until(lambda: node.emcy.log and node.emcy.log[-1].code == code, f"EMCY {code:04X}h")
    return node.emcy.log[-1]


def aborted(code: int) -> "pytest.RaisesExc[canopen.SdoAbortedError]":
    return pytest.raises(ABORTED, match=f"0x{code:08X}")


# -- NMT and error control -------------------------------------------------------------------------------


def test_a_scan_finds_the_nodes_that_are_there(world: World, device: canopen.RemoteNode) -> None:
    world.network.scanner.reset()  # type: ignore[no-untyped-call]
    world.network.scanner.search()
    until(lambda: world.network.scanner.nodes == [DEVICE], "the scan")


def test_every_state_is_entered_and_shown(world: World, device: canopen.RemoteNode) -> None:
    device.sdo[0x1017].raw = 20
    for state in ("OPERATIONAL", "STOPPED", "PRE-OPERATIONAL", "STOPPED", "OPERATIONAL"):
        device.nmt.state = state
        until(lambda state=state: device.nmt.wait_for_heartbeat(WAIT_S) == state, state)  # type: ignore[misc]
    world.network.nmt.state = "STOPPED"  # to all
    until(lambda: device.nmt.wait_for_heartbeat(WAIT_S) == "STOPPED", "the broadcast")


@pytest.mark.parametrize("command", ["RESET", "RESET COMMUNICATION"])
def test_a_reset_ends_in_a_boot_up(world: World, device: canopen.RemoteNode, command: str) -> None:
    device.sdo[0x2001].raw = 77
    device.sdo[0x1017].raw = 20
    reset(device, command)
    assert device.sdo[0x1017].raw == 0
    assert device.sdo[0x2001].raw == (1 if command == "RESET" else 77)


def test_a_stopped_node_does_not_answer_sdo(device: canopen.RemoteNode) -> None:
    device.nmt.state = "STOPPED"
    device.sdo.RESPONSE_TIMEOUT = 0.5
    with pytest.raises(canopen.SdoCommunicationError):
        device.sdo.upload(0x1000, 0)
    device.sdo.RESPONSE_TIMEOUT = WAIT_S
    device.nmt.state = "PRE-OPERATIONAL"
    assert device.sdo[0x1000].raw == 0


def test_node_guarding_sees_the_toggling_state(world: World, device: canopen.RemoteNode) -> None:
    seen: queue.Queue[int] = queue.Queue()
    world.network.subscribe(0x700 + DEVICE, lambda _cob_id, data, _stamp: seen.put(data[0]) if data else None)
    device.nmt.start_node_guarding(0.05)
    assert [seen.get(timeout=WAIT_S) for _ in range(4)] == [0x7F, 0xFF, 0x7F, 0xFF]
    device.nmt.stop_node_guarding()  # type: ignore[no-untyped-call]


def test_a_master_that_falls_silent_is_missed(world: World, device: canopen.RemoteNode) -> None:
    device.sdo[0x1016][1].raw = 0x7F << 16 | 200
    device.nmt.state = "OPERATIONAL"
    heartbeat = world.network.send_periodic(0x77F, b"\x05", 0.05)
    device.sdo[0x2001].raw = 2  # answered: the device lives with the heartbeat
    assert device.emcy.log == []
    heartbeat.stop()  # type: ignore[no-untyped-call]
    error = emergency(device, 0x8130)
    assert (error.register, error.data[0]) == (0x11, 0x7F)
    assert device.sdo[0x1003][1].raw & 0xFFFF == 0x8130
    world.network.send_message(0x77F, b"\x05")
    until(lambda: device.emcy.active == [], "the error is over")


# -- SDO -------------------------------------------------------------------------------------------------

SIZES = (1, 4, 5, 7, 8, 889, 890, 2000)


def content(size: int) -> bytes:
    return random.Random(size).randbytes(size)


@pytest.mark.parametrize("size", SIZES)
def test_a_domain_goes_there_and_back_in_segments_and_blocks(device: canopen.RemoteNode, size: int) -> None:
    data = content(size)
    with device.sdo.open(0x2000, 0, "wb", size=size, block_transfer=True) as file:
        file.write(data)
    assert device.sdo.upload(0x2000, 0) == data
    with device.sdo.open(0x2000, 0, "rb", block_transfer=True) as file:
        assert file.read() == data
    if size <= 890:
        device.sdo.download(0x2000, 0, data[::-1], force_segment=True)
        assert device.sdo.upload(0x2000, 0) == data[::-1]


def test_blocks_follow_blocks(device: canopen.RemoteNode) -> None:
    """Transfers back to back are where stacks get out of step."""
    for size in range(1, 60):
        data = content(size)
        with device.sdo.open(0x2000, 0, "wb", size=size, block_transfer=True) as file:
            file.write(data)
        with device.sdo.open(0x2000, 0, "rb", block_transfer=True) as file:
            assert file.read() == data


def test_a_block_without_crc(device: canopen.RemoteNode) -> None:
    with device.sdo.open(0x2000, 0, "wb", size=100, block_transfer=True, request_crc_support=False) as file:
        file.write(content(100))
    assert device.sdo.upload(0x2000, 0) == content(100)


def test_text_and_large_numbers(device: canopen.RemoteNode) -> None:
    assert device.sdo[0x1008].raw == "A device that is nobody's"
    device.sdo[0x2002].raw = "a name"
    assert device.sdo[0x2002].raw == "a name"
    device.sdo[0x2001].raw = 0xFEDCBA9876543210
    assert device.sdo[0x2001].raw == 0xFEDCBA9876543210


def test_refusals_have_the_standards_codes(device: canopen.RemoteNode) -> None:
    for index, subindex, data, code in (
        (0x3000, 0, b"\0", 0x06020000),
        (0x1018, 9, b"\0", 0x06090011),
        (0x1000, 0, b"\0\0\0\0", 0x06010002),
        (0x1017, 0, b"\0", 0x06070013),
        (0x1017, 0, b"\0\0\0", 0x06070012),
        (0x2001, 0, bytes(9), 0x06070012),
        (0x1003, 0, b"\1", 0x06090030),
        (0x1010, 1, b"evas", 0x08000020),
        (0x1800, 2, b"\xf5", 0x06090030),
        (0x1A00, 0, b"\1", 0x08000022),
    ):
        with aborted(code):
            device.sdo.download(index, subindex, data)
    with aborted(0x06020000):
        device.sdo.upload(0x3000, 0)
    assert device.sdo[0x1017].raw == 0


def test_an_open_transfer_gives_way_to_a_new_one(device: canopen.RemoteNode) -> None:
    stream = device.sdo.open(0x1008, 0, "rb", buffering=0)
    assert stream.read(7) == b"A devic"
    assert device.sdo[0x2001].raw == 1
    with aborted(0x05040001):
        stream.read(7)


def test_a_second_channel_serves_beside_the_first(world: World, device: canopen.RemoteNode) -> None:
    device.sdo[0x1201][1].raw = 0x680 + DEVICE
    device.sdo[0x1201][2].raw = 0x6C0 + DEVICE
    second = device.add_sdo(0x680 + DEVICE, 0x6C0 + DEVICE)  # type: ignore[no-untyped-call]
    second.network = world.network
    second.RESPONSE_TIMEOUT = WAIT_S
    stream = device.sdo.open(0x1008, 0, "rb", buffering=0)
    assert stream.read(7) == b"A devic"
    second[0x2001].raw = 5
    assert stream.read(7) == b"e that "
    assert device.sdo.upload(0x2001, 0) == struct.pack("<Q", 5)


def test_stored_parameters_survive_a_reset_and_are_restored(device: canopen.RemoteNode) -> None:
    device.sdo[0x2001].raw = 42
    reset(device)
    assert device.sdo[0x2001].raw == 1
    device.sdo[0x2001].raw = 42
    device.store()  # type: ignore[no-untyped-call]
    reset(device)
    assert device.sdo[0x2001].raw == 42
    device.restore()  # type: ignore[no-untyped-call]
    assert device.sdo[0x2001].raw == 42
    reset(device)
    assert device.sdo[0x2001].raw == 1


# -- PDO -------------------------------------------------------------------------------------------------


def test_a_mapping_is_changed_and_synchronous_pdos_follow(world: World, device: canopen.RemoteNode) -> None:
    device.tpdo.read()  # type: ignore[no-untyped-call]
    pdo = device.tpdo[1]
    assert [variable.index for variable in pdo] == [0x2010]
    pdo.clear()
    pdo.add_variable(0x2011)
    pdo.add_variable(0x2010)
    pdo.trans_type, pdo.enabled = 2, True
    pdo.save()
    device.sdo[0x2010].raw, device.sdo[0x2011].raw = 0x1234, 0x5678
    received: queue.Queue[bytes] = queue.Queue()
    pdo.add_callback(lambda map_: received.put(bytes(map_.data)))
    device.nmt.state = "OPERATIONAL"
    for _ in range(4):
        world.network.sync.transmit()
    assert [received.get(timeout=WAIT_S) for _ in range(2)] == [b"\x78\x56\x34\x12"] * 2
    assert device.sdo[0x2010].raw == 0x1234  # answered after the SYNCs,
    assert received.empty()  # of which each second one counted


def test_what_the_master_sends_arrives(device: canopen.RemoteNode) -> None:
    device.rpdo.read()  # type: ignore[no-untyped-call]
    device.nmt.state = "OPERATIONAL"
    device.rpdo[1][0].raw = 0x4321
    device.rpdo[1].transmit()
    until(lambda: device.sdo[0x2011].raw == 0x4321, "the value")


def test_events_times_and_requests(device: canopen.RemoteNode) -> None:
    device.tpdo.read()  # type: ignore[no-untyped-call]
    pdo = device.tpdo[1]
    pdo.trans_type, pdo.inhibit_time, pdo.event_timer, pdo.rtr_allowed, pdo.enabled = 255, 100, 0, True, True
    pdo.save()
    received: queue.Queue[bytes] = queue.Queue()
    pdo.add_callback(lambda map_: received.put(bytes(map_.data)))
    device.nmt.state = "OPERATIONAL"
    assert received.get(timeout=WAIT_S) == b"\0\0"
    device.sdo[0x2010].raw = 7
    assert received.get(timeout=WAIT_S) == b"\7\0"
    pdo.remote_request()
    assert received.get(timeout=WAIT_S) == b"\7\0"
    device.sdo[0x1800][5].raw = 20
    assert [received.get(timeout=WAIT_S) for _ in range(5)] == [b"\7\0"] * 5


def test_a_short_pdo_is_an_emergency(world: World, device: canopen.RemoteNode) -> None:
    device.nmt.state = "OPERATIONAL"
    world.network.send_message(0x200 + DEVICE, b"\1")
    assert emergency(device, 0x8210).register == 0x11
    world.network.send_message(0x200 + DEVICE, b"\1\0")
    until(lambda: device.emcy.active == [], "a good one ends it")


def test_no_frame_that_cannot_be_disturbs_a_device(world: World, device: canopen.RemoteNode) -> None:
    device.sdo[0x2001].raw = 9
    noise = random.Random(1)
    with can.Bus(interface="virtual", channel=world.channel) as bus:
        for _ in range(500):
            bus.send(
                can.Message(
                    arbitration_id=noise.choice((0x080, 0x205, 0x605, 0x685, 0x705, 0x72A)),
                    is_remote_frame=noise.random() < 0.2,
                    is_extended_id=noise.random() < 0.2,
                    data=noise.randbytes(noise.randint(0, 7)),  # no SDO request is so short
                )
            )
    assert device.sdo[0x2001].raw == 9


# -- a drive ---------------------------------------------------------------------------------------------


def test_a_drive_is_enabled_and_moved_by_sdo(drive: canopen.RemoteNode) -> None:
    drive.nmt.state = "OPERATIONAL"
    drive.sdo[0x6060].raw = 1
    for index, value in ((0x6081, 60_000), (0x6083, 200_000), (0x6084, 200_000), (0x607A, 20_000)):
        drive.sdo[index].raw = value
    for controlword, state in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
        drive.sdo[0x6040].raw = controlword
        until(lambda state=state: drive.sdo[0x6041].raw & 0x6F == state, hex(state))  # type: ignore[misc]
    drive.sdo[0x6040].raw = 0x1F
    until(lambda: abs(drive.sdo[0x6064].raw - 20_000) < 200, "the target")
    drive.sdo[0x6040].raw = 0x02
    until(lambda: drive.sdo[0x6041].raw & 0x4F == 0x40, "quick stop, then switch on disabled")


def test_a_fault_is_told_and_reset(world: World, drive: canopen.RemoteNode) -> None:
    drive.sdo[0x6007].raw = 1
    drive.sdo[0x1016][1].raw = 0x7F << 16 | 300
    drive.nmt.state = "OPERATIONAL"
    for controlword in (0x06, 0x07, 0x0F):
        drive.sdo[0x6040].raw = controlword
    world.network.send_message(0x77F, b"\x05")
    until(lambda: {0x8130, 0x8100} <= {error.code for error in drive.emcy.log}, "both errors")
    until(lambda: drive.sdo[0x6041].raw & 0x4F == 0x08, "fault")
    assert drive.sdo[0x1001].raw & 0x11 == 0x11
    drive.sdo[0x6040].raw = 0x80
    until(lambda: drive.sdo[0x6041].raw & 0x4F == 0x40, "reset")
    assert drive.sdo[0x1001].raw == 0


# -- any file --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [name for name in shipped() if name != "schunk_prl.eds"])
def test_the_master_reads_a_files_whole_dictionary(world: World, name: str) -> None:
    node = world.run(DEVICE, SHIPPED / name)
    compared = 0
    for variable in variables(node.object_dictionary):
        if variable.access_type == "const" and variable.default is not None:
            raw = node.sdo.upload(variable.index, variable.subindex)
            assert variable.decode_raw(raw) == variable.default
            compared += 1
        elif variable.access_type != "wo" and variable.index != 0x1003:
            node.sdo.upload(variable.index, variable.subindex)
    assert compared


def variables(dictionary: canopen.ObjectDictionary) -> Iterator[ODVariable]:
    for item in dictionary.values():
        if item.index >= 0x20:
            yield from [item] if isinstance(item, ODVariable) else item.subindices.values()


def test_the_master_applies_a_dcf(world: World) -> None:
    """What a DCF says is written to a device that was restored to its factory's defaults."""
    node = world.run(DEVICE, SHIPPED / "elmo_gold.dcf")
    node.restore()  # type: ignore[no-untyped-call]
    reset(node)
    assert node.sdo[0x1800][2].raw == 255
    for pdo in (node.tpdo[1], node.rpdo[1]):
        pdo.read(from_od=True)
        pdo.save()
    assert (node.sdo[0x1800][2].raw, node.sdo[0x1A00][0].raw) == (1, 3)
    assert (node.sdo[0x1400][2].raw, node.sdo[0x1600][0].raw) == (1, 2)
