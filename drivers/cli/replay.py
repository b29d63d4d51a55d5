"""`gwrms sensor record` and `replay`: raw bytes into a file, and again out of a pseudo-terminal."""

import argparse
import math
import os
import pty
import signal
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Self

import msgspec

from drivers.cli.listen import best, listen, nothing
from drivers.errors import Unavailable
from drivers.port import FIRST_RETRY_S, SerialPort

TICK_S = 0.01
LOOK_S = FIRST_RETRY_S / 2  # a port that goes away is seen before it is opened again
DEFAULT_BAUDRATE = 115200


class About(msgspec.Struct, frozen=True):
    """Facts that the bytes lack; beside a capture, as CAPTURE.json."""

    baudrate: int
    seconds: float
    format: str | None = None  # None: nobody has looked


def record_options(parser: argparse.ArgumentParser) -> Callable[[argparse.Namespace], int]:
    parser.description = (
        "Record a port's raw bytes, and beside them FILE.json with baud rate, format and duration. The "
        "command listens first, as gwrms sensor does, and records nothing if no format fits: that may be "
        "noise, at a wrong baud rate."
    )
    parser.add_argument("port", metavar="PORT")
    parser.add_argument("file", metavar="FILE", type=Path)
    parser.add_argument("--baud", type=int, help="default: the first at which a format fits")
    parser.add_argument(
        "--raw",
        action="store_true",
        help=f"record any bytes, as of an unknown sensor (without --baud at {DEFAULT_BAUDRATE})",
    )
    parser.add_argument("--seconds", type=float, help="duration (default: until Ctrl-C or SIGTERM)")
    return record


def replay_options(parser: argparse.ArgumentParser) -> Callable[[argparse.Namespace], int]:
    parser.description = (
        "Send a capture's bytes out of a pseudo-terminal, at the pace at which they were recorded. "
        'Prints {"ready": true, "port": …} when it can be opened.'
    )
    parser.add_argument("file", metavar="FILE", type=Path)
    parser.add_argument("--link", type=Path, help="a path that links to the pseudo-terminal while it exists")
    parser.add_argument("--baud", type=int, default=DEFAULT_BAUDRATE, help="the pace if FILE.json is missing")
    parser.add_argument("--speed", type=float, default=1.0, help="speed relative to the recording")
    parser.add_argument("--loop", action="store_true", help="repeat until Ctrl-C")
    return replay


def record(options: argparse.Namespace) -> int:
    """Record until the time is up, Ctrl-C or SIGTERM; 1 where bytes may be missing in between.

    Raises:
        FileExistsError: there is such a file.
        Unavailable: the port cannot be opened, nothing came, or nothing that a format explains.

    """
    if options.file.exists():
        raise FileExistsError(f"{options.file} is there already: give another name, or remove it")
    baudrate, format_name = (options.baud or DEFAULT_BAUDRATE, None) if options.raw else _recognised(options)
    # What has come is in the file, whatever ends this.
    with _Ended() as ended, options.file.open("xb", buffering=0) as file:

        def keep(data: bytes, _stamp_ns: int) -> None:
            file.write(data)

        port = SerialPort(options.port, baudrate, keep)
        began = time.monotonic()
        port.start()
        try:
            problem = _watch(port, options.seconds, ended)
        finally:
            port.stop()
        size = file.tell()
    if not size:
        options.file.unlink()
        raise Unavailable(problem or f"{options.port} sent nothing: check the sensor's power and its TX wire")
    about = About(baudrate, time.monotonic() - began, format_name)
    _beside(options.file).write_bytes(msgspec.json.encode(about))
    holes = "" if problem is None else ", NOT all that was sent"
    sys.stdout.write(f"{size} bytes in {about.seconds:.1f} s at {baudrate} baud{holes}\n")
    return 0 if problem is None else 1


class _Ended:
    """Inside, Ctrl-C and SIGTERM are only noted, so that what describes the bytes is written beside them.

    For the main thread.
    """

    def __init__(self) -> None:
        self._asked = False

    def __enter__(self) -> Self:
        self._before = {one: signal.signal(one, self._note) for one in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *_: object) -> None:
        for one, before in self._before.items():
            signal.signal(one, before)

    def __bool__(self) -> bool:
        return self._asked

    def _note(self, _signal: int, _frame: FrameType | None) -> None:
        self._asked = True  # and no Event: its lock may be held where the signal comes


def _watch(port: SerialPort, seconds: float | None, ended: _Ended) -> str | None:
    """Wait for the end; say what goes wrong before it at once, and return the last of that."""
    ends_s = time.monotonic() + (math.inf if seconds is None else seconds)
    told: str | None = None
    while not ended and (left_s := ends_s - time.monotonic()) > 0:
        time.sleep(min(left_s, LOOK_S))
        if port.problem not in (None, told):
            told = port.problem
            sys.stderr.write(f"gwrms sensor: {told}\n")
    return port.problem or told


def _recognised(options: argparse.Namespace) -> tuple[int, str]:
    """Baud rate and format of what speaks at the port."""
    heard = []
    for one in listen(options.port, options.baud):
        heard.append(one)
        sys.stderr.write(f"{one.baudrate:>7} baud: {one}\n")
    found = best(heard)
    if found.match is None:
        raise Unavailable(f"{nothing(options.port, heard)}; --raw records it all the same")
    return found.baudrate, found.match.format_name


def replay(options: argparse.Namespace) -> int:
    """Send the capture once, or in a loop."""
    data = options.file.read_bytes()
    seconds = _seconds(options.file, len(data), options.baud) / options.speed
    share = max(1, round(len(data) * TICK_S / max(seconds, TICK_S)))
    pause = threading.Event()
    with _terminal(options.link) as (master, path):
        sys.stdout.write(msgspec.json.encode({"ready": True, "port": path}).decode() + "\n")
        sys.stdout.flush()
        try:
            while True:
                for at in range(0, len(data), share):
                    _send(master, data[at : at + share])
                    pause.wait(TICK_S)
                if not options.loop:
                    return 0
        except KeyboardInterrupt:
            return 0


def _beside(file: Path) -> Path:
    return file.with_name(file.name + ".json")


def _seconds(file: Path, size: int, baudrate: int) -> float:
    """Return the length of the capture; without its description, the time that a busy line takes."""
    try:
        return msgspec.json.decode(_beside(file).read_bytes(), type=About).seconds
    except FileNotFoundError:
        return size * 10 / baudrate


@contextmanager
def _terminal(link: Path | None) -> Iterator[tuple[int, str]]:
    master, slave = pty.openpty()
    try:
        tty.setraw(slave)
        os.set_blocking(master, False)
        path = os.ttyname(slave)
        if link is not None:
            link.symlink_to(path)
        # The other end stays open here, so that a reader that comes and goes ends nothing.
        yield master, str(link or path)
    finally:
        if link is not None and link.is_symlink():
            link.unlink()
        os.close(slave)
        os.close(master)


def _send(master: int, data: bytes) -> None:
    """As a serial line does: what nobody reads is lost."""
    try:
        os.write(master, data)
    except BlockingIOError:
        return
