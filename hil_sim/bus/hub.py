"""A loopback TCP hub: other processes join the simulated bus with python-can's `socketcand` interface.

Every client is a participant of its own: it gets the frames of all others and never its own. A client that
does not read is cut off when too much waits for it; nobody else notices.
"""

import selectors
import socket
from functools import partial
from pathlib import Path

from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.bus.socketcand import Messages, error_message, frame_message, parse_send
from hil_sim.clock import MILLISECOND_NS
from hil_sim.errors import SimulatorError
from hil_sim.loop import Loop

HOST = "127.0.0.1"

_BACKLOG_BYTES = 4 * 1024 * 1024  # about a minute of a walking robot
_READ_BYTES = 65536
# Clients expect their "< ok >" alone in one read: frames come only when it has been fetched.
_PAUSE_NS = 20 * MILLISECOND_NS
_TCP_TABLE = Path("/proc/net/tcp")


def _unread_by(peer: tuple[str, int], hub_port: int) -> bool:
    """Return whether the process at the other end, on this machine, has yet to read bytes from us."""
    try:
        lines = _TCP_TABLE.read_text(encoding="ascii").splitlines()[1:]
    except OSError:
        return False
    ends = f":{peer[1]:04X}", f":{hub_port:04X}"
    for line in lines:
        _, local, remote, _, queues, *_ = line.split()
        if (local[-5:], remote[-5:]) == ends:
            return int(queues.partition(":")[2], 16) > 0
    return False


class _Client:
    """One connection: `raw` once it wants frames, `held` while they wait for its "< ok >" to be read.

    `remote`: it knows a word for remote frames.
    """

    def __init__(self, connection: socket.socket, peer: tuple[str, int]) -> None:
        self.connection = connection
        self.peer = peer
        self.messages = Messages()
        self.waiting = bytearray()
        self.blocked = False
        self.raw = False
        self.held = False
        self.remote = False


class Hub:
    """Listens on `port` of the loopback interface; 0 picks a free one, and `port` then says which."""

    def __init__(self, loop: Loop, bus: CanBus, port: int = 0, epoch_s: float = 0.0) -> None:
        self._loop = loop
        self._bus = bus
        self._epoch_s = epoch_s
        self._clients: dict[socket.socket, _Client] = {}
        self.clients_cut = 0
        self.messages_refused = 0
        self._listener = _listen(port)
        self.port: int = self._listener.getsockname()[1]
        loop.watch(self._listener, selectors.EVENT_READ, self._accept)
        loop.each_turn(self._flush)
        bus.attach(self, self._receive, self._receive_error)

    def close(self) -> None:
        self._bus.detach(self)
        for client in tuple(self._clients.values()):
            self._drop(client)
        self._loop.forget(self._listener)
        self._listener.close()

    # -- clients ---------------------------------------------------------------------------------------

    def _accept(self, _events: int) -> None:
        try:
            connection, peer = self._listener.accept()
        except OSError:  # it left before we came
            return
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        client = _Client(connection, peer)
        self._clients[connection] = client
        self._loop.watch(connection, selectors.EVENT_READ, partial(self._serve, client))
        self._say(client, b"< hi >")

    def _serve(self, client: _Client, events: int) -> None:
        if events & selectors.EVENT_WRITE:
            self._write(client)
        if events & selectors.EVENT_READ and client.connection in self._clients:
            self._read(client)

    def _read(self, client: _Client) -> None:
        try:
            data = client.connection.recv(_READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._drop(client)
            return
        for words in client.messages.feed(data):
            self._obey(client, words)

    def _obey(self, client: _Client, words: list[bytes]) -> None:
        command = words[0] if words else b""
        if command == b"send":
            frame = parse_send(words)
            if frame is None:
                self.messages_refused += 1
            else:
                self._bus.send(frame, client)
        elif command == b"remote":
            client.remote = True
            self._say(client, b"< ok >")
        elif command == b"open":
            self._say(client, b"< ok >")
        elif command == b"rawmode":
            self._say(client, b"< ok >")
            client.raw = client.held = True
            self._bus.clock.after(_PAUSE_NS, partial(self._release, client))
        elif command == b"echo":
            self._say(client, b"< echo >")
        else:
            self.messages_refused += 1
            if not client.raw:
                self._say(client, b"< error unknown command >")

    def _release(self, client: _Client) -> None:
        if client.connection in self._clients and _unread_by(client.peer, self.port):
            self._bus.clock.after(_PAUSE_NS, partial(self._release, client))
        else:
            client.held = False

    def _drop(self, client: _Client) -> None:
        if self._clients.pop(client.connection, None) is not None:
            self._loop.forget(client.connection)
            client.connection.close()

    # -- frames ----------------------------------------------------------------------------------------

    def _receive(self, frame: Frame, sender: object) -> None:
        message = b""
        for client in self._clients.values():
            if client.raw and client is not sender and (client.remote or not frame.remote):
                message = message or frame_message(frame, self._epoch_s + self._bus.clock.now_s)
                client.waiting += message

    def _receive_error(self, error_class: int) -> None:
        message = error_message(error_class, self._epoch_s + self._bus.clock.now_s)
        for client in self._clients.values():
            if client.raw:
                client.waiting += message

    def _say(self, client: _Client, message: bytes) -> None:
        client.waiting += message
        if not client.held:
            self._write(client)

    def _flush(self) -> None:
        for client in tuple(self._clients.values()):
            if client.waiting and not (client.blocked or client.held):
                self._write(client)
            if len(client.waiting) > _BACKLOG_BYTES:
                self.clients_cut += 1
                self._drop(client)

    def _write(self, client: _Client) -> None:
        try:
            sent = client.connection.send(client.waiting)
        except BlockingIOError:
            sent = 0
        except OSError:
            self._drop(client)
            return
        del client.waiting[:sent]
        blocked = bool(client.waiting)
        if blocked is not client.blocked:
            client.blocked = blocked
            events = selectors.EVENT_READ | (selectors.EVENT_WRITE if blocked else 0)
            self._loop.watch(client.connection, events, partial(self._serve, client))


def _listen(port: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
    except OSError as error:
        listener.close()
        raise SimulatorError(
            f"port {port} on {HOST} is taken by another program ({error.strerror}); "
            "stop that program, or give the simulator a fresh --dir"
        ) from error
    listener.listen()
    listener.setblocking(False)
    return listener
