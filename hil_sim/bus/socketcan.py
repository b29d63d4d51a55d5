"""A bridge to a Linux CAN interface: the simulated devices sit on a real bus, beside real ones.

The real bus gives frames their order and time there, so the simulated one carries them at once. What a
simulated device sends goes out and reaches the other simulated ones; what comes from outside reaches all.
"""

import errno
import select
import selectors
import socket
import time
from collections import deque
from collections.abc import Callable, Mapping

from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.bus.interface import InterfaceUnusable, open_interface, to_bytes, to_frame
from hil_sim.clock import MILLISECOND_NS, Event
from hil_sim.errors import SimulatorError
from hil_sim.loop import Loop

LISTEN_S = 1.0  # how long to find out who is there already; heartbeats rarely come less often

_RETRY_NS = 500 * MILLISECOND_NS
_BACKLOG = 256  # frames that the interface does not take yet: about a fifth of a second of a walking robot
_AT_ONCE = 256  # frames received in one go
_FULL = (errno.EAGAIN, errno.ENOBUFS)
_SDO_REQUEST, _SDO_ANSWER, _HEARTBEAT = 0x600, 0x580, 0x700  # CiA 301 §7.3.5, by node id
_READ_DEVICE_TYPE = bytes.fromhex("40 00 10 00 00 00 00 00")


class SocketCanBridge:
    """Carries frames between the simulated bus and the CAN interface called `interface`.

    `nodes` are the names of the simulated devices by node id. `say` is told when the interface goes, with
    what to do, and when it is back.

    Raises:
        InterfaceUnusable: the interface is missing or down.
        SimulatorError: a device on the real bus has the node id of a simulated one. Later, out of the loop.

    """

    def __init__(
        self,
        loop: Loop,
        bus: CanBus,
        interface: str,
        nodes: Mapping[int, str],
        say: Callable[[str], object],
    ) -> None:
        self._loop = loop
        self._bus = bus
        self._interface = interface
        self._nodes = nodes
        self._say = say
        self._problem: str | None = None
        self._retry: Event | None = None
        self._waiting: deque[bytes] = deque(maxlen=_BACKLOG)
        # What nobody but a device of that node id sends.
        self._ours = {base + node for base in (_HEARTBEAT, _SDO_ANSWER) for node in nodes}
        self._socket: socket.socket | None = open_interface(interface)
        try:
            self._refuse_doubles(self._socket)
        except OSError as error:
            self._socket.close()
            raise InterfaceUnusable(f"{interface} went as it was opened: {error.strerror}") from error
        except SimulatorError:
            self._socket.close()
            raise
        bus.carries_at_once = True
        bus.attach(self, self._receive)
        loop.watch(self._socket, selectors.EVENT_READ, self._read)
        loop.each_turn(self._flush)

    def close(self) -> None:
        self._bus.detach(self)
        if self._retry is not None:
            self._retry.cancel()
        self._drop()

    # -- node ids ----------------------------------------------------------------------------------------

    def _refuse_doubles(self, sock: socket.socket) -> None:
        """Ask each node id for its device type (1000h), and listen: nobody may answer to one of ours."""
        for node in self._nodes:
            sock.send(to_bytes(Frame(_SDO_REQUEST + node, _READ_DEVICE_TYPE)))
        end_s = time.monotonic() + LISTEN_S
        while (left_s := end_s - time.monotonic()) > 0:
            if select.select([sock], [], [], left_s)[0]:
                for frame in self._received(sock):
                    self._check(frame)

    def _check(self, frame: Frame) -> None:
        if frame.cob_id in self._ours and not (frame.remote or frame.extended):
            node = frame.cob_id & 0x7F
            raise SimulatorError(
                f"another device on {self._interface} has node id {node}, the one of the simulated "
                f"{self._nodes[node]}: take it off the bus, or do not simulate it (--without)"
            )

    # -- frames ------------------------------------------------------------------------------------------

    def _receive(self, frame: Frame, _sender: object) -> None:
        if self._socket is None:
            return
        if len(self._waiting) == _BACKLOG:  # the oldest makes room
            self._tell(f"{self._interface} takes no frames: does anybody on the bus acknowledge them?")
        self._waiting.append(to_bytes(frame))

    def _flush(self) -> None:
        try:
            while self._socket is not None and self._waiting:
                self._socket.send(self._waiting[0])
                self._waiting.popleft()
                if not self._waiting:
                    self._tell(None)
        except OSError as error:
            if error.errno not in _FULL:
                self._reopen()

    def _read(self, _events: int) -> None:
        if self._socket is None:
            return
        try:
            for frame in self._received(self._socket):
                self._check(frame)
                self._bus.send(frame, self)
        except OSError:
            self._reopen()

    def _received(self, sock: socket.socket) -> list[Frame]:
        """Return the received frames; raises `OSError` if the interface is gone."""
        frames: list[Frame] = []
        while len(frames) < _AT_ONCE:
            try:
                frames.append(to_frame(sock.recv(16)))
            except BlockingIOError:
                break
        return frames

    # -- the interface goes and comes ----------------------------------------------------------------------

    def _reopen(self) -> None:
        """Begin anew; nothing that was not sent in time is sent later."""
        self._drop()
        try:
            self._socket = open_interface(self._interface)
        except InterfaceUnusable as error:
            self._tell(str(error))
            self._retry = self._bus.clock.after(_RETRY_NS, self._reopen)
        else:
            self._loop.watch(self._socket, selectors.EVENT_READ, self._read)
            self._tell(None)

    def _drop(self) -> None:
        self._waiting.clear()
        if self._socket is not None:
            self._loop.forget(self._socket)
            self._socket.close()
            self._socket = None

    def _tell(self, problem: str | None) -> None:
        if problem != self._problem:
            self._problem = problem
            self._say(problem or f"{self._interface} carries frames again")
