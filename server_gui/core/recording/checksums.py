"""Checksums of what a segment of the spool holds: by them it is known what is as it was written."""

import zlib
from typing import Any, Final

from server_gui.core.recording.rows import JournalHead

DATA: Final = 8  # which of a run's columns is its rows; the one after it is its checksum, if it has one


def of_layout(robot: str, description: bytes) -> int:
    """Return the start value of the checksums of a layout's runs."""
    return zlib.crc32(description, zlib.crc32(robot.encode()))


def of_run(layout: int, name: tuple[object, ...], data: bytes) -> int:
    """Return the checksum of a run: its layout (`of_layout`), its name and its rows."""
    return zlib.crc32(data, zlib.crc32(repr(name).encode(), layout))


def of_head(robot: str, head: JournalHead) -> int:
    """Return the checksum of the recorded head of a robot's journal."""
    return zlib.crc32(repr((robot, head.n, head.hash)).encode())


def unaltered(content: object, crc: int | None = None) -> bool:
    """Return whether a record is as it was written, as far as anybody knows."""
    return isinstance(content, bytes) and crc in (None, zlib.crc32(content))


def is_sound(robot: str, description: bytes, *line: Any) -> bool:
    """Return whether a run is as it was written, by its layout's description and all of its columns."""
    data, crc = line[DATA], line[DATA + 1] if len(line) > DATA + 1 else None
    layout = of_layout(robot, description)
    return isinstance(data, bytes) and crc in (None, of_run(layout, line[:DATA], data))
