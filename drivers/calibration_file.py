"""A file that `gwrms calibrate` has written: read as a struct, or refused in words."""

import tomllib
from pathlib import Path
from typing import TypeVar

import msgspec

from drivers.errors import SettingsError

Read = TypeVar("Read", bound=msgspec.Struct)


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
