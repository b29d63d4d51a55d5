"""Recording of a joint test: JSON lines with its conditions, every sample, and its end.

The first line is an object, the following are arrays in the order of its `columns`, the last is an object
with `ended`. Lines are there as soon as they are written, so that a program that is killed leaves what it
had; a file without a last line is of a test that was cut off.
"""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

FORMAT = 1
COLUMNS: Mapping[str, str] = {  # and their units; of a relay the target is N·m
    "sync_ns": "ns",  # when SYNC was sent, on the monotonic clock
    "position_ns": "ns",  # when the PDO with the position was received
    "target": "rad",  # that the drive had from the cycle before on
    "position": "rad",
    "velocity": "rad/s",
    "torque": "N·m",
    "current": "A",
    "statusword": "",
}
Row = tuple[float | None, ...]


class JointTestRecording:
    """One file; raises `OSError` where it cannot be written, and `FileExistsError` where it is there."""

    def __init__(self, path: Path, head: Mapping[str, Any], *, by_torque: bool) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        self._file = os.fdopen(descriptor, "w", encoding="utf-8")
        units = {**COLUMNS, "target": "N·m"} if by_torque else COLUMNS
        self._line({"format": FORMAT, **head, "columns": list(units), "units": list(units.values())})

    def add(self, rows: Sequence[Row]) -> None:
        """Keep these samples."""
        self._file.writelines(json.dumps(row) + "\n" for row in rows)
        self._file.flush()

    def end(self, **how: Any) -> None:
        """Write how it ended, and put all of it on disk."""
        self._line({"ended": how})
        os.fsync(self._file.fileno())

    def _line(self, line: Mapping[str, Any]) -> None:
        self._file.write(json.dumps(line, ensure_ascii=False) + "\n")
        self._file.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
