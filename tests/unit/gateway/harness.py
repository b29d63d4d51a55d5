"""A daemon in a thread, a blocking client that knows nothing of ours, and components from the manual."""

import contextlib
import functools
import json
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pytest

import eds
from drivers.bus.liveness import NodeLife
from drivers.component import Component, ComponentKind
from drivers.errors import DeviceAbort, NotPermitted
from drivers.joint.cia402 import DriveState, drive_state
from drivers.joint.commands import WAY_UP
from drivers.joint.quick_stop import StopOutcome
from drivers.joint.reading import DriveReading
from drivers.joint.transitions import Led
from drivers.latest import Latest
from drivers.samples import Channel, ComponentState, Quality
from gateway.config import RobotConfig, load
from gateway.connections.listeners import listen
from gateway.daemon import Daemon
from gateway.modules.component.assembly import Robot
from gateway.process.futures import done, gather, then
from tests.support.waiting import WAIT_S

Bytes = dict[tuple[int, int], bytes]


class Answered(Exception):
    """An error that the gateway answered."""

    def __init__(self, error: dict[str, Any]) -> None:
        super().__init__(error["message"])
        self.code: int = error["code"]
        self.data: dict[str, Any] = error.get("data", {})
        self.kind: str | None = self.data.get("kind")


class Client:
    """One connection; notifications are kept apart from answers."""

    def __init__(self, address: tuple[str, int]) -> None:
        self.socket = self._connected(address)
        self.notifications: deque[dict[str, Any]] = deque()
        self._answers: dict[Any, dict[str, Any]] = {}
        self._reader = self.socket.makefile("rb")
        self._id = 0

    def _connected(self, address: tuple[str, int]) -> socket.socket:
        return socket.create_connection(address, timeout=WAIT_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        self._reader.close()
        self.socket.close()

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def request(self, method: str, **params: Any) -> int:
        """Send without waiting; returns the id."""
        self._id += 1
        message = {"jsonrpc": "2.0", "id": self._id, "method": method, "params": params}
        self.send(json.dumps(message).encode() + b"\n")
        return self._id

    def line(self) -> dict[str, Any] | None:
        """The next line of any kind; `None` at the end."""
        line = self._reader.readline()
        return json.loads(line) if line else None

    def answer(self, id_: Any) -> Any:
        while id_ not in self._answers:
            message = self.line()
            if message is None:
                raise ConnectionError("closed")
            if "method" in message:
                self.notifications.append(message)
            else:
                self._answers[message["id"]] = message
        message = self._answers.pop(id_)
        assert message["jsonrpc"] == "2.0"
        if "error" in message:
            raise Answered(message["error"])
        return message["result"]

    def call(self, method: str, **params: Any) -> Any:
        return self.answer(self.request(method, **params))

    def refused(self, method: str, **params: Any) -> Answered:
        """The error that this call is answered with."""
        with pytest.raises(Answered) as caught:
            self.call(method, **params)
        return caught.value

    def data(self) -> dict[str, Any]:
        """The next stream notification's parameters."""
        while not self.notifications:
            message = self.line()
            assert message is not None
            if "method" in message:
                self.notifications.append(message)
            else:
                self._answers[message["id"]] = message
        params: dict[str, Any] = self.notifications.popleft()["params"]
        return params


@contextlib.contextmanager
def serving(config: RobotConfig, **options: Any) -> Iterator[tuple[str, int]]:
    """A daemon in a thread; ends it and joins it."""
    daemon = Daemon(config, listen("127.0.0.1", 0), **options)
    ready = threading.Event()
    thread = threading.Thread(target=daemon.run, args=(ready.set,), name="daemon")
    address = daemon.address
    thread.start()
    try:
        assert ready.wait(WAIT_S)
        yield address
    finally:
        daemon.end()
        thread.join(WAIT_S)
        ended = not thread.is_alive()
        if not ended:  # only this test fails: with its threads the suite could not end either
            daemon._loop.post(daemon._loop.stop)
            thread.join(WAIT_S)
        assert ended, "the daemon did not end"


class FakeNode:
    """A device's objects, with the faults that a test wants."""

    def __init__(self, objects: Bytes) -> None:
        self.objects = dict(objects)
        self.log: list[tuple[str, int, bytes | None]] = []
        self.life = NodeLife(None)
        self.ready = True
        self.comes_up = False
        self.answered_ns = 0
        self.distrust: str | None = None  # why nothing may be written to it
        self.before_download: Callable[[int, bytes], None] = lambda index, data: None
        self.before_upload: Callable[[int], None] = lambda index: None
        self.store: Callable[[int, bytes], bytes] = lambda index, data: data

    def upload(self, index: int, subindex: int) -> "Future[bytes]":
        return self._do(lambda: self._upload(index, subindex))

    def upload_all(self, objects: Sequence[tuple[int, int]]) -> "Future[list[bytes | Exception]]":
        each = {str(number): self.upload(*one) for number, one in enumerate(objects)}
        return then(gather(each), lambda found: list(found.values()))

    def download(
        self,
        index: int,
        subindex: int,
        data: bytes,
        timeout_s: float | None = None,
        permitted: Callable[[], str | None] | None = None,
    ) -> "Future[None]":
        def work() -> None:
            objection = self.distrust or (None if permitted is None else permitted())
            if objection is not None:
                raise NotPermitted(objection)
            self._download(index, subindex, data)

        return self._do(work)

    def run(
        self,
        job: Callable[[Any], Any],
        *,
        urgent: bool = False,
        ahead: bytes | None = None,
        wake: bool = True,
    ) -> "Future[Any]":
        return self._do(lambda: job(FakeSdo(self)))

    def wake(self) -> None:
        """It has answered already."""

    def written(self) -> list[tuple[int, bytes | None]]:
        return [(index, data) for what, index, data in self.log if what == "download"]

    def _upload(self, index: int, subindex: int) -> bytes:
        self.log.append(("upload", index, None))
        self.before_upload(index)
        self.answered_ns = time.monotonic_ns()
        if (index, subindex) not in self.objects:
            raise DeviceAbort(f"0x{index:04X}: no such object", 0x0602_0000)
        return self.objects[index, subindex]

    def _download(self, index: int, subindex: int, data: bytes) -> None:
        self.log.append(("download", index, data))
        self.before_download(index, data)
        self.objects[index, subindex] = self.store(index, data)
        self.answered_ns = time.monotonic_ns()

    @staticmethod
    def _do(work: Callable[[], Any]) -> "Future[Any]":
        future: Future[Any] = Future()
        try:
            future.set_result(work())
        except Exception as error:  # noqa: BLE001 - a device's error is the future's
            future.set_exception(error)
        return future


class FakeSdo:
    """A fake node's objects, as a job is given them."""

    timeout_s = 0.1

    def __init__(self, node: FakeNode) -> None:
        self._node = node

    def upload(self, index: int, subindex: int, attempts: int = 1, timeout_s: float | None = None) -> bytes:
        return self._node._upload(index, subindex)

    def download(self, index: int, subindex: int, data: bytes, timeout_s: float | None = None) -> None:
        self._node._download(index, subindex, data)


class FakeComponent:
    """A component whose samples a test gives by hand."""

    def __init__(
        self,
        name: str,
        kind: ComponentKind,
        quantities: Sequence[str],
        stale_after_s: float = 1000.0,
        lost: str | None = None,
    ) -> None:
        self.name = name
        self.kind = kind
        self.channels = tuple(Channel(f"{name}.{quantity}", name, quantity, "rad") for quantity in quantities)
        self.latest = Latest(name, self.channels, stale_after_s)
        self.lost: str | None = None  # why it is not there
        self.started = 0
        self.stopped = 0
        self.node = FakeNode({})

    def start(self) -> None:
        self.started += 1

    def stop(self) -> None:
        self.stopped += 1
        self.latest.clear()

    def give(self, *values: float | None, stamp_ns: int | None = None) -> None:
        stamp_ns = time.monotonic_ns() if stamp_ns is None else stamp_ns
        self.latest.update(stamp_ns, tuple(range(len(values))), values)

    def quality(self, now_ns: int) -> Quality:
        state = ComponentState.OK if self.lost is None else ComponentState.LOST
        age_ns = self.latest.age_ns(now_ns)
        return Quality(state, None if age_ns is None else age_ns / 1e6, self.lost, {"frames": 7})


ENABLED, QUICK_STOPPED, DISABLED = (
    0x1237,
    0x1217,
    0x1250,
)  # statuswords (CiA 402-2)


class FakeDrive(FakeComponent):
    """A CiA 402 drive that stops when it is asked, unless told otherwise."""

    def __init__(self, name: str, statusword: int = ENABLED) -> None:
        super().__init__(name, ComponentKind.JOINT, ["position", "statusword"])
        self.reading: DriveReading | None = None
        self.position = 0.5  # rad; stays where it is when the drive changes its state
        self.stops = 0
        self.stopping = StopOutcome.CONFIRMED
        self.hanging: Future[StopOutcome] | None = None
        self.limp = self.nmt_stops = self.resets = 0
        self.limping = StopOutcome.CONFIRMED
        self.led = Led(DriveState.SWITCH_ON_DISABLED)
        self.steps: list[DriveState] = []
        self.on_step: Callable[[DriveState], None] = lambda origin: None
        self.led_up: dict[DriveState, Led] = {}
        self.set_state(statusword)

    def set_state(self, statusword: int) -> None:
        self.node.objects[0x6041, 0] = statusword.to_bytes(2, "little")
        self.give(self.position, statusword)

    def start(self) -> None:
        super().start()
        self.set_state(int.from_bytes(self.node.objects[0x6041, 0], "little"))

    def quick_stop(self, *, wake: bool = True) -> "Future[StopOutcome]":
        self.stops += 1
        if self.hanging is not None:
            return self.hanging
        if self.stopping is StopOutcome.CONFIRMED:
            self.set_state(QUICK_STOPPED)
        return done(self.stopping)

    def wake(self) -> None:
        """It has answered already."""

    def disable_voltage(self) -> "Future[StopOutcome]":
        self.limp += 1
        if self.limping is StopOutcome.CONFIRMED:
            self.set_state(DISABLED)
        return done(self.limping)

    def nmt_stop(self) -> None:
        self.nmt_stops += 1

    def reset(self, wanted: Callable[[], bool] = lambda: True) -> "Future[Led]":
        self.resets += 1
        if self.led.problem is None:
            self.set_state(DISABLED)
        return done(self.led)

    def look(self) -> "Future[Led]":
        """Where it is; where a test has made up how far it is led, that."""
        asked_ns = time.monotonic_ns()
        if self.led.problem is not None:
            return done(replace(self.led, asked_ns=asked_ns))
        statusword = int.from_bytes(self.node.objects[0x6041, 0], "little")
        return done(Led(drive_state(statusword), asked_ns=asked_ns))

    def step_up(self, origin: DriveState, wanted: Callable[[], bool] = lambda: True) -> "Future[Led]":
        self.steps.append(origin)
        self.on_step(origin)
        return done(self.led_up.get(origin) or Led(WAY_UP[origin][1]))


# Requests as they are on the wire: the id is to be put in, and the reason.
CLOCK = b'{"jsonrpc":"2.0","id":%d,"method":"clock.read"}\n'
STOP = b'{"jsonrpc":"2.0","id":"stop","method":"robot.stop","params":{"reason":"%s"}}\n'

HEAD = """
[robot]
name = "exo-test"
[gateway]
port = 0
linger_s = 0.05
[can.main]
interface = "virtual"
channel = "unused"
"""

ROBOT = (
    HEAD
    + """
[joint.left_knee]
bus = "main"
node_id = 2
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 100.0
[joint.right_knee]
bus = "main"
node_id = 5
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 100.0
[device.gait]
bus = "main"
node_id = 16
eds = "gait_controller.eds"
[insole.left_insole]
port = "/dev/null-left"
[parameter."gait.step_length"]
object = "0x2001:0"
unit = "m"
scale = 0.001
min = 0.25
max = 0.60
max_step = 0.10
live = true
[parameter."gait.cycle_time"]
object = "0x2002:0"
unit = "s"
scale = 0.001
live = true
[parameter."gait.toe_height"]
object = "0x2003:0"
unit = "m"
scale = 0.001
[parameter."left_knee.max_torque"]
object = "0x6072:0"
unit = "%"
scale = 0.1
"""
)


def config(folder: Path, text: str = ROBOT) -> RobotConfig:
    path = folder / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return load(path)


@functools.cache
def _description(file: str) -> eds.Description:
    """Loading one takes longer than most tests, and nobody changes it."""
    return eds.load(eds.locate(file, None), 1)


class Bench:
    """The robot of `ROBOT` made of fakes."""

    def __init__(self) -> None:
        self.left = FakeDrive("left_knee")
        self.right = FakeDrive("right_knee")
        self.gait = FakeComponent("gait", ComponentKind.DEVICE, [])
        self.insole = FakeComponent("left_insole", ComponentKind.INSOLE, ["force", "cop_x"])
        self.gait.node.objects |= {
            (0x2001, 0): (400).to_bytes(2, "little"),
            (0x2002, 0): (1200).to_bytes(2, "little"),
            (0x2003, 0): (80).to_bytes(2, "little"),
        }
        self.left.node.objects[0x6072, 0] = (1000).to_bytes(2, "little")
        self.insole.give(300.0, None)
        self.absent: dict[str, tuple[ComponentKind, str]] = {}
        self.files = {
            "left_knee": "joint_drive.eds",
            "right_knee": "joint_drive.eds",
            "gait": "gait_controller.eds",
        }
        self.assembled = 0

    @property
    def components(self) -> Mapping[str, Component]:
        everything: list[Component] = [self.left, self.right, self.gait, self.insole]
        return {one.name: one for one in everything if one.name not in self.absent}

    def assemble(self, config: RobotConfig) -> Robot:
        self.assembled += 1
        descriptions = {name: _description(file) for name, file in self.files.items()}
        return Robot({}, dict(self.components), descriptions, dict(self.absent))
