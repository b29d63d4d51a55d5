"""Connections that say the same again and again, as fast as they are taken; and what they were told."""

import json
import os
import selectors
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass

PRINTED = 60  # characters
FIRST_BYTES = 1 << 16  # of what one connection is told that are looked at
ELSEWHERE, SAME = "127.0.0.2", "127.0.0.1"  # an attacker has an address of its own, or the stopper's
IP_BIND_ADDRESS_NO_PORT = 24  # of Linux: the port is chosen by where it connects to
CONNECT_S = 5.0
AGAIN_S = 0.01  # until a connection that was ended is made anew


@dataclass(frozen=True)
class Target:
    """The gateway, and how long it is attacked."""

    address: tuple[str, int]
    seconds: float
    source: str = ELSEWHERE  # the attacker's own address

    def connect(self, receive_bytes: int | None = None) -> socket.socket:
        """A connection; whoever wants to read little says how much may wait."""
        made = socket.socket()
        try:
            if receive_bytes is not None:
                made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
            made.setsockopt(socket.IPPROTO_IP, IP_BIND_ADDRESS_NO_PORT, 1)
            made.bind((self.source, 0))
            made.settimeout(CONNECT_S)
            made.connect(self.address)
        except OSError:
            made.close()
            raise
        return made


@dataclass(frozen=True)
class Said:
    """What the attacker was told: the first error, or else how its connections ended."""

    text: str
    answered: bool = False  # with any byte at all
    ended: int = 0  # connections that the gateway ended, or refused

    @classmethod
    def of(cls, error: str | None, end: str | None, *, answered: bool, ended: int) -> "Said":
        text = error or end or ("answered" if answered else "nothing; still connected")
        return cls(printable(text), answered, ended)


def printable(text: str) -> str:
    """As much as there is room for."""
    return "".join(one if one.isprintable() else "·" for one in text)[:PRINTED]


def error_in(line: bytes) -> str | None:
    """The message of an error; nothing for any other line."""
    try:
        found = json.loads(line)
        message = found["error"]["message"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    return message if isinstance(message, str) else str(message)


@dataclass(frozen=True)
class Manner:
    """How a connection speaks: `opening` once, then `payload` for ever, `piece` bytes each `pause_s`.

    With `silent`, what it is told is not read.
    """

    payload: bytes = b""
    opening: bytes = b""
    piece: int = 1 << 16
    pause_s: float = 0.0
    silent: bool = False


class Connection:
    """One of them."""

    def __init__(self, target: Target, manner: Manner) -> None:
        self.error: str | None = None
        self.answered = False
        self.due = 0.0
        self._manner = manner
        self._told = b""
        self._out = memoryview(manner.opening or manner.payload)
        self.socket = target.connect(4096 if manner.silent else None)
        self.socket.setblocking(False)

    @property
    def events(self) -> int:
        speaks = bool(self._out) and time.monotonic() >= self.due
        return selectors.EVENT_READ * (not self._manner.silent) | selectors.EVENT_WRITE * speaks

    def speak(self) -> None:
        """Send the next piece."""
        sent = self.socket.send(self._out[: self._manner.piece])
        self._out = self._out[sent:] or memoryview(self._manner.payload)
        if self._manner.pause_s:
            self.due = time.monotonic() + self._manner.pause_s

    def hear(self) -> bool:
        """Read; false at the end."""
        data = self.socket.recv(1 << 18)
        self.answered |= bool(data)
        if self.error is None and len(self._told) < FIRST_BYTES:
            *lines, self._told = (self._told + data).split(b"\n")
            self.error = next((text for line in lines if (text := error_in(line)) is not None), None)
        return bool(data)


class Barrage:
    """So many connections; one that is ended is made anew."""

    def __init__(self, target: Target, connections: int, manner_of: Callable[[int], Manner]) -> None:
        self._target = target
        self._manner_of = manner_of
        self._selector = selectors.DefaultSelector()
        self._missing = dict.fromkeys(range(connections), 0.0)  # and when it is made
        self._open: dict[int, Connection] = {}
        self._error: str | None = None
        self._end: str | None = None
        self._answered = False
        self._ended = 0

    def run(self) -> Said:
        """For as long as the target is attacked."""
        until = time.monotonic() + self._target.seconds
        with self._selector:
            while time.monotonic() < until:
                self._connect()
                self._turn()
            for number in tuple(self._open):
                self._close(number)
        return Said.of(self._error, self._end, answered=self._answered, ended=self._ended)

    def _connect(self) -> None:
        now = time.monotonic()
        for number in [one for one, due in self._missing.items() if due <= now]:
            try:
                made = Connection(self._target, self._manner_of(number))
            except OSError as error:
                self._note_end(number, str(error))
                continue
            del self._missing[number]
            self._open[number] = made
            self._selector.register(made.socket, selectors.EVENT_READ, number)

    def _turn(self) -> None:
        quiet = []
        for number, one in self._open.items():
            events = one.events
            if events:
                self._selector.modify(one.socket, events, number)
            else:
                quiet.append(number)
        for number in quiet:  # it neither reads nor speaks now
            self._selector.modify(self._open[number].socket, selectors.EVENT_WRITE, -1 - number)
        for key, events in self._selector.select(0.02):
            if key.data >= 0:
                self._serve(key.data, events)
            elif reason := self._open[-1 - key.data].socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
                self._drop(-1 - key.data, os.strerror(reason))
        if quiet:
            time.sleep(0.005)

    def _serve(self, number: int, events: int) -> None:
        one = self._open[number]
        try:
            if events & selectors.EVENT_READ and not one.hear():
                self._drop(number, "the connection was closed")
            elif events & selectors.EVENT_WRITE:
                one.speak()
        except BlockingIOError:
            return
        except OSError as error:
            self._drop(number, error.strerror or str(error))

    def _drop(self, number: int, why: str) -> None:
        self._close(number)
        self._note_end(number, why)

    def _note_end(self, number: int, why: str) -> None:
        self._ended += 1
        self._end = self._end or why
        self._missing[number] = time.monotonic() + AGAIN_S

    def _close(self, number: int) -> None:
        one = self._open.pop(number)
        self._error, self._answered = self._error or one.error, self._answered or one.answered
        self._selector.unregister(one.socket)
        one.socket.close()


def barrage(target: Target, connections: int, manner: Manner) -> Said:
    """All in the same manner."""
    return Barrage(target, connections, lambda _number: manner).run()


def request(method: str, *, number: int = 1, **params: object) -> bytes:
    """One request as a line."""
    message = {"jsonrpc": "2.0", "id": number, "method": method, "params": params}
    return json.dumps(message).encode() + b"\n"
