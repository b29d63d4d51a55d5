"""The devices that a robot's file names, whatever else is wrong in it."""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import eds
from drivers.errors import SettingsError
from drivers.trace.devices import Device

_TABLES = ("joint", "device", "imu")
_NODE_IDS = range(1, 128)


def devices(path: Path, channel: str | int | None) -> Iterator[Device]:
    """Yield the devices of `[joint.…]`, `[device.…]` and `[imu.…]` with a node id and an EDS.

    With `channel`, those of the bus that has it, where there is one such; a node of several joints has all of
    their names.

    Raises:
        SettingsError: the file cannot be read, or an EDS in it.

    """
    try:
        file = tomllib.loads(path.read_text("utf-8-sig"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise SettingsError(f"{path}: cannot be read: {error}") from error
    buses = {name for name, table in _tables(file.get("can")) if str(table.get("channel")) == str(channel)}
    found: dict[int, tuple[list[str], str]] = {}
    for kind in _TABLES:
        for name, table in _tables(file.get(kind)):
            node_id, description = table.get("node_id"), table.get("eds")
            if (
                isinstance(node_id, int)
                and node_id in _NODE_IDS
                and isinstance(description, str)
                and _is_on(table, buses)
            ):
                found.setdefault(node_id, ([], description))[0].append(name)
    for node_id, (names, description) in found.items():
        yield described(node_id, "/".join(names), description, path)


def described(node_id: int, name: str | None, description: str, beside: Path | None) -> Device:
    """Return a device with its EDS, beside `beside` or one that ships; raises `SettingsError`."""
    try:
        return Device(node_id, name, eds.load(eds.locate(description, beside), node_id))
    except eds.EdsError as error:
        raise SettingsError(str(error)) from error


def _is_on(table: dict[str, Any], buses: set[str]) -> bool:
    return not buses or table.get("bus") in buses


def _tables(table: object) -> Iterator[tuple[str, dict[str, Any]]]:
    if isinstance(table, dict):
        yield from ((name, one) for name, one in table.items() if isinstance(one, dict))
