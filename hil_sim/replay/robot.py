"""A recording with its doors open: the same bus and the same serial ports as a simulated robot has."""

import heapq
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from operator import itemgetter
from pathlib import Path

from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.clock import Clock
from hil_sim.loop import Loop
from hil_sim.replay import capture, robot_config
from hil_sim.replay.can_log import CanLog, ReplayError
from hil_sim.replay.nodes import SDO_ANSWER, SDO_REQUEST, RecordedNode, seen
from hil_sim.replay.player import Player, Timed
from hil_sim.sensors.serial_port import SerialPort
from hil_sim.simulation_host import SimulationHost

_SDO = {base + node: node for base in (SDO_REQUEST, SDO_ANSWER) for node in range(1, 128)}


class ReplayedRobot(SimulationHost):
    """Plays CAN logs and serial captures, by the names of their ports, in a folder; see `SimulationHost`.

    Of several channels in the logs `channel` is played. With `loop` it begins anew at the end, otherwise it
    stops then. Nodes that were recorded and have an EDS in the folder's robot.toml answer SDO (`nodes`).

    Raises `ReplayError`, when it is made: every log is read once.
    """

    def __init__(
        self,
        folder: Path,
        logs: Sequence[Path],
        captures: Mapping[str, Path] | None = None,
        channel: str | None = None,
        loop: bool = False,
        virtual_channel: str | None = None,
        speed: float | None = 1.0,
        epoch_s: float = 0.0,
    ) -> None:
        bus = CanBus(Clock())
        super().__init__(folder, bus, virtual_channel, speed, epoch_s)
        self._logs = [CanLog(path, channel) for path in logs]
        self._captures = {name: capture.load(path) for name, path in (captures or {}).items()}
        self._ports: dict[str, SerialPort] = {}
        self._survey()
        self._player = Player(bus.clock, self._recording, self._first_ns, loop, self.stop)
        self.recorded_nodes = seen(self._identifiers)
        self.nodes: dict[int, RecordedNode] = {}

    def _survey(self) -> None:
        """Read every log: when it all begins, who is there, and what was asked by SDO."""
        begins = [one.began_ns for one in self._captures.values() if one.began_ns is not None]
        self._identifiers: set[int] = set()
        self._sdo: dict[int, list[Frame]] = {}
        for log in self._logs:
            for number, (stamp_ns, frame) in enumerate(log):
                if number == 0:
                    begins.append(stamp_ns)
                if frame is not None and not (frame.extended or frame.remote):
                    self._identifiers.add(frame.cob_id)
                    if frame.cob_id in _SDO:
                        self._sdo.setdefault(_SDO[frame.cob_id], []).append(frame)
        if not (self._logs or self._captures):
            raise ReplayError("there is nothing to play: give a CAN log or a serial capture")
        self._first_ns = min(begins, default=0)

    # -- the doors ---------------------------------------------------------------------------------------

    def _config_text(self, bus: str) -> str:
        return robot_config.text(self.folder.path, bus, self.recorded_nodes, self._captures)

    def _furnish(self, loop: Loop, closing: ExitStack) -> None:  # noqa: ARG002 - nothing else waits in it
        for name, one in self._captures.items():
            self._ports[name] = SerialPort(self.folder.link(name), one.baudrate)
            closing.callback(self._ports[name].close)
        for node_id, description in robot_config.descriptions(self.config).items():
            if node_id in self.recorded_nodes:
                sdo = self._sdo.get(node_id, [])
                self.nodes[node_id] = RecordedNode(self._bus, node_id, description, sdo, self)
        self._player.play()

    # -- what is played ----------------------------------------------------------------------------------

    def _recording(self) -> Iterator[Timed]:
        frames = [self._frames(log) for log in self._logs]
        pieces = [self._pieces(name) for name in self._captures]
        return heapq.merge(*frames, *pieces, key=itemgetter(0))

    def _frames(self, log: CanLog) -> Iterator[Timed]:
        for stamp_ns, frame in log:
            yield stamp_ns, self._bus.tell_error if frame is None else partial(self._play, frame)

    def _pieces(self, name: str) -> Iterator[Timed]:
        for stamp_ns, data in self._captures[name].pieces(self._first_ns):
            yield stamp_ns, partial(self._ports[name].write, data)

    def _play(self, frame: Frame) -> None:
        """Deliver the frame at its time: it was arbitrated when recorded."""
        node = None if frame.extended else self.nodes.get(_SDO.get(frame.cob_id, 0))
        if node is None:
            self._bus.deliver(frame, self)
        else:
            node.overheard(frame)
