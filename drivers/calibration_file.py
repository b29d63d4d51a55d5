"""A file that `gwrms calibrate` has written: read as a struct, or refused in words."""

import hashlib
import tomllib
from pathlib import Path
from typing import Final, TypeVar

import msgspec

from drivers.errors import SettingsError

Read = TypeVar("Read", bound=msgspec.Struct)
DIGITS: Final = 12  # of a digest: enough to tell two files of a robot apart


def load(path: Path, kind: type[Read], what: str, command: str, key: str) -> Read:
    """Return the file at `path`; `what` it is, which `command` writes it and which `key` names it is told.

    Raises:
        SettingsError: it cannot be read or is wrong; the message names file and key.

    """
    try:
        return msgspec.convert(tomllib.loads(path.read_text(encoding="utf-8")), kind)
    except OSError as error:
        raise SettingsError(
            f"{what} {path} cannot be read ({error.strerror}): {command} writes it; "
            f"leave the key `{key}` out until then"
        ) from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise SettingsError(f"{what} {path}: {error}") from error


def mark(path: Path) -> str:
    """Return a file's name and the beginning of its SHA-256, which tell it from any other."""
    try:
        return f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()[:DIGITS]}"
    except OSError as error:
        raise SettingsError(f"{path} cannot be read ({error.strerror})") from error
