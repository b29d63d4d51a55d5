"""A serial port's bytes as `gwrms sensor record` keeps them: FILE, and FILE.json beside it.

FILE holds the raw bytes as they came, and nothing else. FILE.json is an object:

    baudrate   of the port
    seconds    how long it was recorded; the bytes are spread evenly over that time
    began_s    when that began, Unix time; where it is missing, with the first frame of the CAN logs
"""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil_sim.clock import MILLISECOND_NS, SECOND_NS
from hil_sim.replay.can_log import ReplayError
from hil_sim.sensors.serial_port import BAUDRATES

_TICK_NS = 5 * MILLISECOND_NS


@dataclass(frozen=True, slots=True)
class Capture:
    """The bytes of one port; times in ns."""

    baudrate: int
    duration_ns: int
    began_ns: int | None
    data: bytes

    def pieces(self, first_ns: int) -> Iterator[tuple[int, bytes]]:
        """Yield when which bytes have come, for a capture without a beginning from `first_ns` on."""
        began_ns = first_ns if self.began_ns is None else self.began_ns
        size, sent = len(self.data), 0
        for elapsed_ns in range(_TICK_NS, self.duration_ns + _TICK_NS, _TICK_NS):
            end = min(size * elapsed_ns // self.duration_ns, size)
            if end > sent:
                yield began_ns + elapsed_ns, self.data[sent:end]
                sent = end


def load(path: Path) -> Capture:
    """Read a capture; raises `ReplayError`."""
    about_path = path.with_name(path.name + ".json")
    try:
        data = path.read_bytes()
        about = json.loads(about_path.read_bytes())
    except OSError as error:
        missing = about_path if error.filename == str(about_path) else path
        raise ReplayError(f"{missing} cannot be read: {error.strerror}; {_EXAMPLE}") from error
    except ValueError as error:
        raise ReplayError(f"{about_path} is no JSON ({error}); {_EXAMPLE}") from error
    if not data:
        raise ReplayError(f"{path} is empty: nothing was recorded")
    return _made(about_path, about, data)


_EXAMPLE = 'beside a capture stands its FILE.json like {"baudrate": 115200, "seconds": 12.5}'


def _made(path: Path, about: Any, data: bytes) -> Capture:
    if not isinstance(about, dict):
        raise ReplayError(f"{path} is no object; {_EXAMPLE}")
    baudrate, began_s = about.get("baudrate"), about.get("began_s")
    if baudrate not in BAUDRATES:
        raise ReplayError(f"{path}: baudrate {baudrate} is none that a terminal has; {_EXAMPLE}")
    duration_ns = _nanoseconds(path, "seconds", about.get("seconds"))
    if duration_ns <= 0:
        raise ReplayError(f"{path}: in {duration_ns / SECOND_NS:g} seconds nothing comes; {_EXAMPLE}")
    return Capture(
        baudrate, duration_ns, None if began_s is None else _nanoseconds(path, "began_s", began_s), data
    )


def _nanoseconds(path: Path, key: str, seconds: Any) -> int:
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not math.isfinite(seconds):
        raise ReplayError(f"{path}: {key} is {seconds}, not a number of seconds; {_EXAMPLE}")
    return round(seconds * SECOND_NS)
