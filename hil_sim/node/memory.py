"""Non-volatile memory of a device: in this process, or in a file that outlives it."""

import json
import os
from pathlib import Path
from typing import Protocol

from hil_sim.errors import SimulatorError
from hil_sim.node.dictionary import Key

Kept = dict[Key, bytes]


class Memory(Protocol):
    """The values of objects as they were stored, encoded; `None` where nothing was ever stored."""

    def load(self) -> Kept | None:
        """Read the kept memory; raises `SimulatorError` for invalid contents."""

    def save(self, kept: Kept) -> None:
        """Keep the values before returning; raises `OSError` if they cannot be kept."""


class ProcessMemory:
    """Keeps as long as the process lives."""

    def __init__(self) -> None:
        self._kept: Kept | None = None

    def load(self) -> Kept | None:
        return None if self._kept is None else dict(self._kept)

    def save(self, kept: Kept) -> None:
        self._kept = dict(kept)


class FileMemory:
    """Keeps in the file at `path`, for `device` alone: another device in its place begins with nothing.

    The file holds the old values or the new ones, whenever the process or the computer stops.
    """

    def __init__(self, path: Path, device: str) -> None:
        self._path = path
        self._device = device

    def load(self) -> Kept | None:
        try:
            text = self._path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return None
        try:
            contents = json.loads(text)
            if contents["device"] != self._device:
                return None
            return {_key(name): bytes.fromhex(value) for name, value in contents["objects"].items()}
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise SimulatorError(
                f"{self._path} does not hold a device's stored parameters ({error}); "
                "delete it, and the device begins with its defaults"
            ) from error

    def save(self, kept: Kept) -> None:
        objects = {
            f"{index:04X}:{subindex}": value.hex() for (index, subindex), value in sorted(kept.items())
        }
        text = json.dumps({"device": self._device, "objects": objects}, indent=1)
        self._path.parent.mkdir(parents=True, exist_ok=True)
        new = self._path.with_name(self._path.name + ".new")
        with new.open("w", encoding="utf-8") as file:
            file.write(text + "\n")
            file.flush()
            os.fsync(file.fileno())
        new.replace(self._path)
        _sync_folder(self._path.parent)


def _key(name: str) -> Key:
    index, _, subindex = name.partition(":")
    return int(index, 16), int(subindex)


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
