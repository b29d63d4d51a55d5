"""A robot of eight drives as a process of its own, for the benchmark of the simulator.

`python -m tests.bench._sim DIR BUSES SYNC_HZ`: the simulated exoskeleton, walking in real time, and two more
drives that `Leader` moves; with two buses they are on the second one. It says the hubs' ports and runs until
its standard input ends.
"""

import json
import math
import selectors
import sys
from pathlib import Path

import eds
from hil_sim import personality
from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.bus.hub import Hub
from hil_sim.clock import SECOND_NS, Clock
from hil_sim.controller.drives import DriveStatus
from hil_sim.drive.drive import JointDrive
from hil_sim.drive.mechanics import Joint, JointConstants
from hil_sim.node.node import Node
from hil_sim.robot import SimulatedRobot

EXTRA = (7, 8)
CYCLIC_POSITION = 8
CYCLE_PERIOD, INTERPOLATION_TIME = (0x1006, 0), (0x60C2, 1)
STATUSWORD_BYTES = 2
SWING, SWING_S = 20_000, 2.0  # counts, and seconds of one swing


class Leader:
    """Master of some drives: a set-point to each with every SYNC, its own where `period_ns` is given."""

    def __init__(self, clock: Clock, bus: CanBus, nodes: tuple[int, ...], period_ns: int | None) -> None:
        self._clock = clock
        self._bus = bus
        self._drives = {0x180 + node: DriveStatus(node, clock) for node in nodes}
        bus.attach(self, self._receive)
        clock.after(SECOND_NS // 5, self._start)
        if period_ns is not None:
            clock.every(period_ns, self._sync)

    def _start(self) -> None:
        self._bus.send(Frame(0x000, b"\x01\x00"), self)

    def _sync(self) -> None:
        self._bus.send(Frame(0x080), self)
        self._command()

    def _receive(self, frame: Frame, _sender: object) -> None:
        if frame.cob_id == 0x080:
            self._command()
        elif frame.cob_id in self._drives:
            self._drives[frame.cob_id].take(int.from_bytes(frame.data[:STATUSWORD_BYTES], "little"))

    def _command(self) -> None:
        target = round(SWING * math.sin(math.tau * self._clock.now_s / SWING_S))
        for seen in self._drives.values():
            data = seen.way_up.to_bytes(2, "little") + bytes([CYCLIC_POSITION])
            self._bus.send(
                Frame(0x200 + seen.node_id, data + target.to_bytes(4, "little", signed=True)), self
            )


class Machine:
    """The robot in a folder with its two more drives; `buses` are one or two."""

    def __init__(self, folder: Path, buses: int, sync_hz: int, speed: float | None = 1.0) -> None:
        self.robot = SimulatedRobot(folder, speed=speed)
        exoskeleton = self.robot.exoskeleton
        clock, first = exoskeleton.clock, exoskeleton.bus
        self.buses = [first, CanBus(clock)][:buses]
        last = self.buses[-1]
        description = eds.locate("joint_drive.eds", None)
        self.extra = [
            JointDrive(
                clock,
                last,
                f"extra_{node}",
                node,
                personality.describe(description, node),
                Joint(JointConstants()),
            )
            for node in EXTRA
        ]
        for drive in (*exoskeleton.drives.values(), *self.extra):
            give(drive, INTERPOLATION_TIME, 1000 // sync_hz)
        give(exoskeleton.controller, CYCLE_PERIOD, 1_000_000 // sync_hz)
        Leader(clock, last, EXTRA, None if last is first else SECOND_NS // sync_hz)

    def open(self) -> list[int]:
        """Switch everything on; returns the hubs' ports."""
        self.robot.open()
        for drive in self.extra:
            drive.power_on()
        more = [Hub(self.robot.loop, bus) for bus in self.buses[1:]]
        self._hubs = more
        return [self.robot.port or 0, *(hub.port for hub in more)]

    def close(self) -> None:
        for hub in self._hubs:
            hub.close()
        self.robot.close()


def give(node: Node, key: tuple[int, int], value: int) -> None:
    """A default of the device, before it is switched on."""
    node.dictionary[key].default = node.dictionary[key].value = value


def main() -> None:
    folder, buses, sync_hz = sys.argv[1:4]
    machine = Machine(Path(folder), int(buses), int(sync_hz))
    ports = machine.open()
    loop = machine.robot.loop
    loop.watch(sys.stdin.fileno(), selectors.EVENT_READ, lambda _: machine.robot.stop())
    sys.stdout.write(json.dumps({"ports": ports}) + "\n")
    sys.stdout.flush()
    machine.robot.run()
    loop.forget(sys.stdin.fileno())
    sys.stdout.write(json.dumps({"skipped_s": loop.skipped_ns / SECOND_NS}) + "\n")
    machine.close()


if __name__ == "__main__":
    main()
