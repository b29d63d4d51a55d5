"""The socketcand protocol in raw mode: text messages in `< … >`, frames both ways.

It has no word for remote frames. Whoever says `< remote >` before it opens the bus knows ours: `R` in place
of length and data.
"""

import binascii
import re

from hil_sim.bus.can_bus import Frame

MAX_PENDING = 4096  # bytes of an unfinished message

_MESSAGE = re.compile(rb"<([^<>]*)>")
_EXTENDED_DIGITS = 8
_REMOTE = b"R"


def frame_message(frame: Frame, stamp_s: float) -> bytes:
    """Return a received frame; without data the field is empty, and its two spaces stay."""
    message = b"< frame %08X %.6f %b >" if frame.extended else b"< frame %03X %.6f %b >"
    content = _REMOTE if frame.remote else binascii.hexlify(frame.data).upper()
    return message % (frame.cob_id, stamp_s, content)


def error_message(error_class: int, stamp_s: float) -> bytes:
    """Return an error frame, as the interface saw it on the bus."""
    return f"< error {error_class:03X} {stamp_s:.6f} >".encode("ascii")


def parse_send(words: list[bytes]) -> Frame | None:
    """Return the frame in `send ID LENGTH BYTE…` or `send ID R`, `None` if that is not what it is."""
    is_remote = words[2:] == [_REMOTE]
    if is_remote:
        words = [*words[:2], b"0"]
    if not all(word.isalnum() for word in words):  # what int() would take beyond digits
        return None
    try:
        identifier, length, *data = words[1:]
        frame = Frame(
            int(identifier, 16),
            bytes(int(byte, 16) for byte in data),
            len(identifier) == _EXTENDED_DIGITS,
            is_remote,
        )
        fits = len(data) == int(length, 16) <= 8 and frame.cob_id < (1 << (29 if frame.extended else 11))
    except ValueError:
        return None
    return frame if fits else None


class Messages:
    """Takes the stream of one client apart into messages, each a list of words."""

    def __init__(self) -> None:
        self._pending = b""
        self.bytes_dropped = 0

    def feed(self, data: bytes) -> list[list[bytes]]:
        buffer = self._pending + data
        end = 0
        messages = []
        for match in _MESSAGE.finditer(buffer):
            messages.append(match[1].split())
            end = match.end()
        self._pending = buffer[end:]
        if len(self._pending) > MAX_PENDING:
            self.bytes_dropped += len(self._pending)
            self._pending = b""
        return messages
