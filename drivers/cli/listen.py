"""Listening on a serial port for an unknown sensor: baud rate by baud rate, until a format fits."""

import os
import select
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from drivers.errors import Unavailable
from drivers.identify import Match, recognise
from drivers.port import open_port

BAUDRATES = (115200, 230400, 9600, 460800, 921600, 57600, 38400, 19200, 4800)
LISTEN_S = 1.0
SURE = 0.9  # a share of the bytes that needs no other baud rate tried


@dataclass(frozen=True, slots=True)
class BaudRateSample:
    """Result of listening at one baud rate."""

    baudrate: int
    bytes: int
    match: Match | None

    def __str__(self) -> str:
        if not self.bytes:
            return "silent"
        if self.match is None:
            return f"{self.bytes} bytes in no format known"
        match = self.match
        cells = f", {match.cells} cells" if match.cells else ""
        explained = f"{match.frames} frames explain {match.share:.0%} of {self.bytes} bytes"
        return f"{match.format_name}{cells}: {explained}"


def listen(port: str, baudrate: int | None = None) -> Iterator[BaudRateSample]:
    """Yield the result of listening at this baud rate, or at each, until a format fits.

    Raises:
        Unavailable: the port cannot be opened, or goes away.

    """
    for each in (baudrate,) if baudrate else BAUDRATES:
        data = _read(port, each, LISTEN_S)
        heard = BaudRateSample(each, len(data), recognise(data))
        yield heard
        if heard.match is not None and heard.match.share >= SURE:
            return


def best(heard: Sequence[BaudRateSample]) -> BaudRateSample:
    """Return the candidate of which a format explains most."""
    return max(heard, key=lambda one: one.match.share if one.match else -1.0)


def nothing(port: str, heard: Sequence[BaudRateSample]) -> str:
    """Return a remedy if no format fits, in words."""
    if not any(one.bytes for one in heard):
        return f"{port} is silent: check the sensor's power and its TX wire, and whether it has to be started"
    rates = f"{heard[0].baudrate} baud" if len(heard) == 1 else "any usual baud rate"
    return (
        f"{port} sends bytes that no known format explains at {rates}: try another --baud, or describe it in "
        "a layout file (formats insole-csv and insole-frame)"
    )


def _read(port: str, baudrate: int, seconds: float) -> bytes:
    data = b""
    until = time.monotonic() + seconds
    with open_port(port, baudrate) as line:
        while (left := until - time.monotonic()) > 0:
            if select.select([line.fileno()], [], [], left)[0]:
                try:
                    part = os.read(line.fileno(), 4096)
                except OSError as error:
                    raise Unavailable(f"{port} went away while it was read: check its cable") from error
                if not part:
                    raise Unavailable(f"{port} went away while it was read: check its cable")
                data += part
    return data
