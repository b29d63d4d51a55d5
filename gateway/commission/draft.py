"""The findings so far and their sources: kept beside the future file, and saved after every finding."""

import fcntl
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import msgspec

from drivers.errors import SettingsError
from gateway.records import durable

SUFFIX = ".commission"
LOCK = ".commission.lock"
MOST_AXES = 8  # of a node (CiA 402-2)
KINDS: Mapping[str, Any] = {  # what is reckoned with
    "name": str,
    "joints": list[str],
    "node_id": Annotated[int, msgspec.Meta(ge=1, le=127)],
    "axis": Annotated[int, msgspec.Meta(ge=0, lt=MOST_AXES)],
    "direction": int,
    **dict.fromkeys(("counts_per_revolution", "gear_ratio", "zero_offset", "min", "max"), float),
}


class DraftValue(msgspec.Struct, frozen=True):
    """One value of the robot's file, and how it was found, for its comment."""

    value: Any
    how: str = ""


@contextmanager
def alone(file: Path) -> Iterator[None]:
    """Keep others from commissioning `file` within the block.

    Raises:
        SettingsError: somebody does, or nothing can be written beside it.

    """
    path = file.with_name(file.name + LOCK)
    try:
        lock = path.open("ab")
    except OSError as error:
        raise SettingsError(f"{file} could not be written: {path}: {error.strerror or error}") from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not os.path.samestat(os.fstat(lock.fileno()), path.stat()):
                raise FileNotFoundError  # who had it has just removed it: somebody may hold another one
        except (BlockingIOError, FileNotFoundError) as error:
            raise SettingsError(
                f"{file}: another gwrms commission, or joint-test, is at it: end that first"
            ) from error
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


class Draft:
    """Values by table and key, as `("joint.left_knee", "node_id")`; any that is there is not asked again."""

    def __init__(self, file: Path, *, go_on: bool = True) -> None:
        """Open the draft of the robot's file `file`, to continue it; without `go_on` a new one.

        Raises:
            SettingsError: what was left cannot be read.

        """
        self.file = file
        self.path = file.with_name(file.name + SUFFIX)
        self.tables: dict[str, dict[str, DraftValue]] = {}
        if go_on:
            try:
                self.tables = self._left()
            except (OSError, ValueError, RecursionError, msgspec.MsgspecError) as error:
                raise SettingsError(
                    f"{self.path}: cannot be gone on with: {error}; remove it to begin anew"
                ) from error

    def _left(self) -> dict[str, dict[str, DraftValue]]:
        """Return what was found before; nothing where there is no draft."""
        try:
            data = self.path.read_bytes()
        except (FileNotFoundError, NotADirectoryError):
            return {}
        tables = msgspec.json.decode(data, type=dict[str, dict[str, DraftValue]])
        for key, found in (pair for keys in tables.values() for pair in keys.items()):
            msgspec.convert(found.value, KINDS.get(key, Any))
        return tables

    def has(self, table: str, key: str) -> bool:
        return key in self.tables.get(table, {})

    def value(self, table: str, key: str, default: Any = None) -> Any:
        found = self.tables.get(table, {}).get(key)
        return default if found is None else found.value

    def put(self, table: str, key: str, value: Any, how: str = "") -> None:
        """Keep a finding; raises `OSError` where it cannot be kept."""
        self.tables.setdefault(table, {})[key] = DraftValue(value, how)
        durable.write(self.path, msgspec.json.format(msgspec.json.encode(self.tables)))

    def forget(self, table: str, *keys: str) -> None:
        """Ask for these again; without keys, for the whole table."""
        kept = self.tables.pop(table, {})
        if keys:
            self.tables[table] = {key: found for key, found in kept.items() if key not in keys}

    def forget_node(self, node: int) -> None:
        """Ask again for all that was found of a node, and of the joints that it moves."""
        self.forget(f"node.{node}")
        for table in [one for one in self.tables if one.startswith("joint.")]:
            if self.value(table, "node_id") == node:
                joint = table.removeprefix("joint.")
                for one in (table, f"told.{joint}", f"guard.rule.{joint}_range"):
                    self.forget(one)

    def end(self) -> None:
        """Remove the draft after the file is written."""
        durable.remove(self.path)
