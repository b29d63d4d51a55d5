"""What a fully loaded 1 Mbit/s bus costs: our drivers beside canopen's own PdoMap, in the same run.

Eight drives send 8,457 TPDOs a second (statusword, position, torque; 8 bytes each). Counted is the processor
time of the receiving thread alone, as a part of one core, and every frame.
"""

import json
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import can
import canopen

import eds
from drivers.bus.bus import CanBus
from drivers.bus.frames import Transport
from drivers.bus.interfaces.socketcan import SocketCanTransport
from drivers.bus.settings import CanSettings
from drivers.joint.drive import JointDrive
from drivers.joint.settings import JointSettings
from tests.bench._drives import DRIVES, Drives, objects
from tests.unit.joint.conftest import drive_eds

RATE = 8457.0
SECONDS = 4.0
WARM_UP_S = 1.0


@dataclass(frozen=True)
class Result:
    """One row of the table."""

    name: str
    sent: int
    received: int
    core_percent: float
    limit_percent: float | None

    @property
    def kept(self) -> bool:
        if self.limit_percent is None:
            return True
        return self.received == self.sent and self.core_percent <= self.limit_percent


Stream = Callable[[float, float], int]


def thread_seconds(thread: threading.Thread) -> float:
    """Processor time that a running thread has used."""
    if thread.ident is None:
        raise RuntimeError(f"{thread.name} does not run")
    return time.clock_gettime(time.pthread_getcpuclockid(thread.ident))


def thread_called(part: str) -> threading.Thread:
    return next(thread for thread in threading.enumerate() if part in thread.name)


def measure(
    name: str, stream: Stream, thread: threading.Thread, count: Callable[[], int], limit: float | None
) -> Result:
    stream(RATE, WARM_UP_S)
    settle(count)
    before, cpu = count(), thread_seconds(thread)
    sent = stream(RATE, SECONDS)
    settle(count)
    return Result(name, sent, count() - before, 100 * (thread_seconds(thread) - cpu) / SECONDS, limit)


def settle(count: Callable[[], int]) -> None:
    """Until no frame has come for a tenth of a second."""
    last = -1
    while count() != last:
        last = count()
        time.sleep(0.1)


@contextmanager
def process(
    *arguments: str, pass_fds: tuple[int, ...] = ()
) -> Iterator[tuple[Stream, subprocess.Popen[str]]]:
    """The drives in a process of their own."""
    with subprocess.Popen(
        [sys.executable, "-m", "tests.bench._drives", *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        pass_fds=pass_fds,
    ) as child:

        def stream(rate: float, seconds: float) -> int:
            if child.stdin is None or child.stdout is None:
                raise RuntimeError("the drives have no pipes")
            child.stdin.write(f"{rate} {seconds}\n")
            child.stdin.flush()
            return int(child.stdout.readline())

        yield stream, child
        if child.stdin is not None:
            child.stdin.close()


@contextmanager
def joints(
    settings: CanSettings, folder: Path, transport: Transport | None = None
) -> Iterator[list[JointDrive]]:
    """Eight joints, ready; over `transport` where one is given instead of what the settings name."""
    bus = CanBus("bench", settings)
    made = []
    for node_id in range(1, DRIVES + 1):
        path = folder / "drive.eds"
        path.write_text(drive_eds(objects(node_id)))
        joint = JointSettings(
            bus="bench", node_id=node_id, eds="", counts_per_revolution=4096, gear_ratio=100, slow_poll_hz=0
        )
        made.append(JointDrive(f"joint_{node_id}", joint, bus, eds.load(path, node_id)))
    opening: AbstractContextManager[object] = nullcontext()
    if transport is not None:  # where the kernel has no CAN, the bus gets one that is open already
        opening = patch("drivers.bus.bus.open_transport", lambda _: transport)
    with opening:
        for one in made:
            one.start()
        while not all(one.node.ready for one in made):
            time.sleep(0.01)
        yield made
        for one in made:
            one.stop()


def ours(name: str, stream: Stream, made: list[JointDrive], limit: float) -> Result:
    return measure(name, stream, thread_called("can bench"), lambda: sum(one.frames for one in made), limit)


@contextmanager
def pdo_maps(bus: can.BusABC, folder: Path) -> Iterator[list[int]]:
    """canopen's way: each frame decoded by its PdoMap, three values read by `.raw`."""
    count = [0]
    network = canopen.Network(bus)
    network.NOTIFIER_CYCLE = 0.1
    network.connect()
    for node_id in range(1, DRIVES + 1):
        path = folder / "drive.eds"
        path.write_text(drive_eds(objects(node_id)))
        node = network.add_node(node_id, eds.load(path, node_id).object_dictionary)
        node.tpdo.read()  # type: ignore[no-untyped-call]
        variables = list(node.tpdo[1])

        def on_frame(_map: object, variables: list[canopen.variable.Variable] = variables) -> None:
            for variable in variables:
                variable.raw  # noqa: B018 - reading it is what is measured
            count[0] += 1

        node.tpdo[1].add_callback(on_frame)
    yield count
    network.disconnect()


def theirs(name: str, stream: Stream, count: list[int]) -> Result:
    return measure(name, stream, thread_called("Notifier"), lambda: count[0], None)


def through_socketcand(folder: Path) -> Iterator[Result]:
    with process("0") as (stream, child):
        port = read_port(child)
        settings = CanSettings(
            interface="socketcand", channel="bench", more={"host": "127.0.0.1", "port": port}
        )
        with joints(settings, folder) as made:
            yield ours("socketcand", stream, made, 20)
    with process("0") as (stream, child):
        port = read_port(child)
        bus = can.Bus("bench", "socketcand", host="127.0.0.1", port=port, tcp_tune=True)
        with pdo_maps(bus, folder) as count:
            yield theirs("socketcand", stream, count)


def through_virtual(folder: Path) -> Iterator[Result]:
    settings = CanSettings(interface="virtual", channel="bench")
    with virtual_drives() as stream, joints(settings, folder) as made:
        yield ours("virtual", stream, made, 20)
    with virtual_drives() as stream, pdo_maps(can.Bus("bench", "virtual"), folder) as count:
        yield theirs("virtual", stream, count)


@contextmanager
def virtual_drives() -> Iterator[Stream]:
    """python-can's virtual bus is one process only: the drives share it with their reader."""
    done = threading.Event()
    with can.Bus("bench", "virtual") as bus:

        def send(can_id: int, data: bytes) -> None:
            bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

        drives = Drives(send)

        def answer() -> None:
            while not done.is_set():
                message = bus.recv(0.05)
                if message is not None:
                    drives.hear(message.arbitration_id, bytes(message.data))

        thread = threading.Thread(target=answer, name="virtual drives")
        thread.start()
        yield drives.stream
        done.set()
        thread.join()


def through_raw_reader(folder: Path) -> Iterator[Result]:
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with process("fd", str(far.fileno()), pass_fds=(far.fileno(),)) as (stream, _):
        far.close()
        transport = SocketCanTransport(near, "AF_UNIX datagrams")
        with joints(CanSettings(interface="socketcan", channel="bench"), folder, transport) as made:
            yield ours("raw reader over AF_UNIX", stream, made, 10)


def read_port(child: subprocess.Popen[str]) -> int:
    if child.stdout is None:
        raise RuntimeError("the drives have no pipes")
    return int(child.stdout.readline())


def main() -> int:
    """Print the table; 1 where a limit was not kept."""
    results: list[tuple[str, Result]] = []
    with tempfile.TemporaryDirectory() as name:
        for source in (through_socketcand, through_virtual, through_raw_reader):
            results += [
                ("GWRMS" if row.limit_percent else "canopen PdoMap", row) for row in source(Path(name))
            ]
    sys.stdout.write(f"CAN: {RATE:,.0f} frames/s of 8 drives for {SECONDS:g} s, one core = 100 %\n")
    sys.stdout.write(f"{'through':<26}{'reader':<16}{'sent':>8}{'lost':>8}{'core %':>9}{'limit':>8}\n")
    for reader, row in results:
        limit = "" if row.limit_percent is None else f"{row.limit_percent:g}"
        lost = row.sent - row.received
        sys.stdout.write(
            f"{row.name:<26}{reader:<16}{row.sent:>8}{lost:>8}{row.core_percent:>9.1f}{limit:>8}\n"
        )
    sys.stdout.write(
        "The raw SocketCAN reader is timed over AF_UNIX datagrams that carry struct can_frame.\n"
    )
    figures = [{"reader": reader, **vars(row)} for reader, row in results]
    sys.stdout.write(json.dumps({"benchmark": "can", "results": figures}) + "\n")
    return 0 if all(row.kept for _, row in results) else 1


if __name__ == "__main__":
    sys.exit(main())
