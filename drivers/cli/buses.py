"""The buses that a command is told: by an interface's name, or by a robot's file."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from drivers.bus.settings import CanSettings
from drivers.errors import SettingsError


def named(buses: Sequence[str], bitrate: int | None) -> Iterator[tuple[str, CanSettings]]:
    """Yield each bus by its name: `can0`, `INTERFACE:CHANNEL` of python-can, or those of a robot's file.

    Raises:
        SettingsError: it is no name, or a robot's file has none or cannot be read.

    """
    for bus in buses:
        if bus.endswith(".toml"):
            yield from _of_file(Path(bus))
            continue
        interface, _, channel = bus.partition(":") if ":" in bus else ("socketcan", ":", bus)
        if not interface.strip() or not channel.strip():
            raise SettingsError(f"{bus!r} names no bus: can0, or INTERFACE:CHANNEL, or a robot's file")
        yield bus, CanSettings(interface=interface, channel=channel, bitrate=bitrate)


def _of_file(path: Path) -> Iterator[tuple[str, CanSettings]]:
    """Yield the buses of a robot's file; the rest of it may be wrong.

    Raises:
        SettingsError: it has none, or cannot be read.

    """
    try:
        tables: Mapping[str, Mapping[str, Any]] = tomllib.loads(path.read_text("utf-8-sig")).get("can", {})
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise SettingsError(f"{path}: cannot be read: {error}") from error
    if not tables:
        raise SettingsError(f"{path}: has no [can.NAME] table")
    for name, table in tables.items():
        try:
            yield name, CanSettings.from_table(table)
        except msgspec.ValidationError as error:
            raise SettingsError(f"{path}: [can.{name}]: {error}") from error
