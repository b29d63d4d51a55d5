"""The simulator's door to a CAN interface, with a pair of sockets for the interface and its bus."""

import json
import socket
import struct
import tomllib
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from hil_sim.bus import interface, socketcan
from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.bus.interface import InterfaceUnusable, open_interface, to_bytes, to_frame
from hil_sim.bus.socketcan import SocketCanBridge
from hil_sim.cli.sim import main
from hil_sim.clock import MILLISECOND_NS, SECOND_NS, Clock
from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import CONTROLLER, JOINTS, Exoskeleton
from hil_sim.faults.fault import FaultRefused
from hil_sim.faults.injector import Faults
from hil_sim.loop import Loop
from hil_sim.robot import SimulatedRobot
from hil_sim.truth import TruthFile

DOWN = "can7 is down; run: sudo ip link set can7 up type can bitrate 1000000 restart-ms 100"


class Wire:
    """Stands for the interface: gives the bridge one end of a pair of sockets, keeps the other."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.problem: str | None = None
        self.outside = self._ours = socket.socket()
        monkeypatch.setattr(socketcan, "open_interface", self._open)
        monkeypatch.setattr(socketcan, "LISTEN_S", 0.02)
        self.before_opening: list[Frame] = []

    def _open(self, _name: str) -> socket.socket:
        if self.problem is not None:
            raise InterfaceUnusable(self.problem)
        self.close()
        self._ours, self.outside = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._ours.setblocking(False)
        self.outside.setblocking(False)
        for frame in self.before_opening:
            self.outside.send(to_bytes(frame))
        return self._ours

    def take(self) -> list[Frame]:
        """What has gone out since the last time."""
        frames = []
        while True:
            try:
                frames.append(to_frame(self.outside.recv(16)))
            except BlockingIOError:
                return frames

    def close(self) -> None:
        self.outside.close()
        self._ours.close()


class Bench:
    """A bus with two devices and the bridge; time moves by `run`."""

    def __init__(self, wire: Wire) -> None:
        self.said: list[str] = []
        self.heard: dict[str, list[int]] = {"one": [], "two": []}
        self.clock = Clock()
        self.loop = Loop(self.clock, speed=None)
        self.bus = CanBus(self.clock)
        for name in self.heard:
            self.bus.attach(name, self._hearing(name))
        try:
            self.bridge = SocketCanBridge(self.loop, self.bus, "can7", {2: "left_knee"}, self.said.append)
        except SimulatorError:
            self.loop.close()
            raise
        self.wire = wire
        self.asked = wire.take()

    def _hearing(self, name: str) -> Callable[[Frame, object], None]:
        return lambda frame, _: self.heard[name].append(frame.cob_id)

    def run(self, milliseconds: int = 20) -> None:
        self.loop.run(self.clock.now_ns + milliseconds * MILLISECOND_NS)

    def close(self) -> None:
        self.bridge.close()
        self.loop.close()


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Iterator[Wire]:
    with closing(Wire(monkeypatch)) as wire:
        yield wire


@pytest.fixture
def bench(wire: Wire) -> Iterator[Bench]:
    with closing(Bench(wire)) as bench:
        yield bench


def test_what_a_device_sends_goes_out_once_and_reaches_the_others_but_not_itself(bench: Bench) -> None:
    bench.bus.send(Frame(0x181, b"\x01"), "one")
    bench.run()
    assert bench.wire.take() == [Frame(0x181, b"\x01")]
    assert bench.heard == {"one": [], "two": [0x181]}


def test_what_comes_from_outside_reaches_every_device_and_is_not_sent_back(bench: Bench) -> None:
    bench.wire.outside.send(to_bytes(Frame(0x602, bytes(8))))
    bench.run()
    assert bench.heard == {"one": [0x602], "two": [0x602]}
    assert bench.wire.take() == []


def test_a_real_bus_gives_frames_their_time_and_the_simulated_one_only_their_order(bench: Bench) -> None:
    for cob_id in (0x700, 0x300, 0x80):
        bench.bus.send(Frame(cob_id, bytes(8)), "one")
    bench.clock.run_until(bench.clock.now_ns)
    assert bench.heard["two"] == [0x700, 0x80, 0x300]
    assert bench.bus.busy_ns > 0


def test_before_anything_else_it_asks_who_has_the_node_id(bench: Bench) -> None:
    assert bench.asked == [Frame(0x602, bytes.fromhex("40 00 10 00 00 00 00 00"))]


@pytest.mark.parametrize("frame", [Frame(0x582, bytes(8)), Frame(0x702, b"\x05")])
def test_a_node_id_that_somebody_has_already_is_refused(wire: Wire, frame: Frame) -> None:
    wire.before_opening = [Frame(0x181), frame]
    with pytest.raises(SimulatorError, match=r"another device on can7 has node id 2, .* simulated left_knee"):
        Bench(wire)


def test_a_node_id_that_somebody_brings_later_ends_the_simulator(bench: Bench) -> None:
    bench.wire.outside.send(to_bytes(Frame(0x702, remote=True)))  # only asks for it
    bench.wire.outside.send(to_bytes(Frame(0x703, b"\x00")))
    bench.run()
    bench.wire.outside.send(to_bytes(Frame(0x702, b"\x00")))
    with pytest.raises(SimulatorError, match="has node id 2"):
        bench.run()


def test_an_interface_that_goes_is_named_and_used_again_when_it_is_back(bench: Bench) -> None:
    bench.wire.problem = DOWN
    bench.wire.outside.close()
    bench.bus.send(Frame(0x181), "one")
    bench.run()
    bench.bus.send(Frame(0x182), "one")
    bench.run(2000)
    assert bench.said == [DOWN]
    assert bench.heard["two"] == [0x181, 0x182]
    bench.wire.problem = None
    bench.run(1000)
    assert bench.said == [DOWN, "can7 carries frames again"]
    bench.bus.send(Frame(0x183), "one")
    bench.run()
    assert bench.wire.take() == [Frame(0x183)]  # nothing old


def test_frames_that_nobody_takes_are_kept_for_a_moment_and_said(bench: Bench) -> None:
    sent = 0
    while not bench.said:
        bench.bus.send(Frame(0x181, struct.pack("<Q", sent)), "one")
        sent += 1
        bench.run(1)
    assert bench.said == ["can7 takes no frames: does anybody on the bus acknowledge them?"]
    taken = bench.wire.take()
    while len(bench.said) == 1:
        bench.run(1)
        taken += bench.wire.take()
    assert bench.said[1:] == ["can7 carries frames again"]
    assert taken[-1].data == struct.pack("<Q", sent - 1)
    assert len(taken) == sent - 1  # the oldest that waited made room


@pytest.mark.parametrize(
    ("frame", "data"),
    [
        (Frame(0x181, b"\x01\x02"), b"\x81\x01\0\0\x02\0\0\0\x01\x02\0\0\0\0\0\0"),
        (Frame(0x12345678, b"", extended=True), b"\x78\x56\x34\x92\0\0\0\0" + bytes(8)),
        (Frame(0x702, remote=True), b"\x02\x07\0\x40\0\0\0\0" + bytes(8)),
    ],
)
@pytest.mark.skipif(struct.pack("=H", 1) != b"\x01\x00", reason="the bytes below are little-endian")
def test_frames_as_the_kernel_writes_them(frame: Frame, data: bytes) -> None:
    assert to_bytes(frame) == data
    assert to_frame(data) == frame


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("can7", "there is no interface can7: plug the adapter in"),
        ("vcan7", "sudo ip link add vcan7 type vcan && sudo ip link set vcan7 up"),
        ("a name that is far too long", "there is no interface"),
    ],
)
def test_an_interface_that_is_not_there_is_refused_in_words(name: str, words: str) -> None:
    with pytest.raises(InterfaceUnusable, match=words):
        open_interface(name)


def test_an_interface_without_can_is_refused_in_words() -> None:
    with pytest.raises(
        InterfaceUnusable, match=r"lo (is no CAN interface|cannot be used, this kernel has no CAN)"
    ):
        open_interface("lo")


@pytest.mark.parametrize(
    ("adapter", "line"),
    [
        (True, "sudo ip link set can7 up type can bitrate 1000000 restart-ms 100"),
        (False, "sudo ip link set can7 up"),
    ],
)
def test_only_an_adapter_is_given_a_bit_rate(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, adapter: bool, line: str
) -> None:
    monkeypatch.setattr(interface, "_INTERFACES", tmp_path)
    if adapter:
        (tmp_path / "can7" / "device").mkdir(parents=True)
    assert interface._up_line("can7") == line


class Left:
    """A robot whose left leg and controller are somebody else's."""

    without = ("left_hip", "left_knee", "left_ankle", CONTROLLER)
    simulated = ("right_hip", "right_knee", "right_ankle")


def test_nodes_that_are_left_out_never_say_a_word() -> None:
    robot = Exoskeleton(without=Left.without)
    heard = set[int]()
    robot.bus.attach("listener", lambda frame, _: heard.add(frame.cob_id))
    robot.power_on()
    robot.clock.run_until(SECOND_NS)
    assert {cob_id & 0x7F for cob_id in heard} == {JOINTS[name] for name in Left.simulated}


def test_the_controller_leads_no_drive_that_is_not_simulated() -> None:
    with pytest.raises(SimulatorError, match=r"would enable and move a left_knee .* leave gait out too"):
        Exoskeleton(without=("left_knee",))
    assert CONTROLLER not in {node.name for node in Exoskeleton(without=(CONTROLLER,)).nodes}


def test_no_fault_is_made_on_what_is_not_simulated(tmp_path: Path) -> None:
    faults = Faults(Exoskeleton(without=Left.without), tmp_path)
    with pytest.raises(FaultRefused, match="left_knee is not simulated here"):
        faults.begin("node_lost", "left_knee")


def test_robot_toml_names_the_interface_and_only_what_is_simulated(wire: Wire, tmp_path: Path) -> None:
    robot = SimulatedRobot(tmp_path, interface="can7", without=Left.without)
    robot.open()
    robot.close()
    described = tomllib.loads(robot.config.read_text(encoding="utf-8"))
    assert described["can"]["main"] == {"interface": "socketcan", "channel": "can7"}
    assert tuple(described["joint"]) == Left.simulated
    assert {name.partition(".")[0] for name in described["parameter"]} == set(Left.simulated)
    assert not {"device", "stop"} & set(described)


def test_the_truth_says_nothing_of_a_joint_that_is_not_simulated(tmp_path: Path) -> None:
    robot = Exoskeleton(without=Left.without)
    with closing(TruthFile(tmp_path / "truth", robot)):
        robot.power_on()
        robot.clock.run_until(SECOND_NS)
    head, *_, last = map(json.loads, (tmp_path / "truth").read_text(encoding="utf-8").splitlines())
    values = dict(zip(head["columns"], last, strict=True))
    assert values["left_knee.position"] is values["left_knee.velocity"] is None
    assert values["right_knee.position"] is not None


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--bus", "slcan:can0", "slcan:can0 is no bus: give hub, or socketcan:NAME"),
        ("--bus", "socketcan:", "socketcan: is no bus"),
        ("--without", "left_knee,gate", "there is no 'gate': left_hip, "),
    ],
)
def test_wrong_usage_is_explained(
    capsys: pytest.CaptureFixture[str], option: str, value: str, words: str
) -> None:
    assert main(["--dir", "x", option, value]) == 2
    assert words in capsys.readouterr().err
