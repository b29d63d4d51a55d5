"""A CAN adapter on a serial line, as the LAWICEL manual describes it: a terminal here, the bus there."""

import os
import pty
import selectors
import threading
import tty
from types import TracebackType
from typing import Self

import can

_BITRATES = {b"S6": 500_000, b"S8": 1_000_000}
_DIGITS = {b"t": 3, b"T": 8}  # of the identifier in a data frame
_OK, _SENT, _ERROR = b"\r", b"z\r", b"\a"


class SerialAdapter:
    """Obeys on `port`, and carries data frames to and from `channel` while it is told to be open."""

    def __init__(self, channel: str) -> None:
        self.bitrate: int | None = None
        self._is_open = False
        self._bus = can.Bus(channel=channel, interface="socketcan")
        self._terminal, self._other_end = pty.openpty()  # its other end stays open when nobody is there
        tty.setraw(self._other_end)
        self.port = os.ttyname(self._other_end)
        self._rest = b""
        self._leave, self._end = os.pipe()
        self._thread = threading.Thread(target=self._serve, name="serial adapter")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.write(self._end, b"x")
        self._thread.join()
        self._bus.shutdown()
        for descriptor in (self._terminal, self._other_end, self._leave, self._end):
            os.close(descriptor)

    def _serve(self) -> None:
        with selectors.DefaultSelector() as selector:
            for file in (self._terminal, self._bus.fileno(), self._leave):
                selector.register(file, selectors.EVENT_READ)
            while self._leave not in (ready := {key.fd for key, _ in selector.select()}):
                if self._terminal in ready:
                    self._hear()
                if self._bus.fileno() in ready:
                    self._receive()

    def _hear(self) -> None:
        *commands, self._rest = (self._rest + os.read(self._terminal, 4096)).split(b"\r")
        for command in commands:
            os.write(self._terminal, self._obey(command))

    def _obey(self, command: bytes) -> bytes:
        if command[:1] in _DIGITS and self._is_open:
            return self._transmit(command, _DIGITS[command[:1]])
        if command in _BITRATES:
            self.bitrate = _BITRATES[command]
        elif command in (b"O", b"C"):
            self._is_open = command == b"O"
        elif command:
            return _ERROR
        return _OK

    def _transmit(self, command: bytes, digits: int) -> bytes:
        data = bytes.fromhex(command[2 + digits :].decode())
        identifier = int(command[1 : 1 + digits], 16)
        self._bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=digits == 8))
        return _SENT

    def _receive(self) -> None:
        message = self._bus.recv(timeout=0)
        if message is not None and self._is_open:
            head = "T{:08X}" if message.is_extended_id else "t{:03X}"
            content = f"{message.dlc}{message.data.hex().upper()}\r"
            os.write(self._terminal, (head.format(message.arbitration_id) + content).encode())
