"""`ROBOT.toml:NAME` in place of a port: the table of a sensor in a robot's file."""

import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from drivers.errors import SettingsError


class Named(NamedTuple):
    """A table as it stands there; the file has it below the name of the sensor's kind."""

    file: Path
    name: str
    tables: Mapping[str, Any]  # all of the file
    table: Mapping[str, Any]  # the sensor's


@contextmanager
def named(where: str, kind: str) -> Iterator[Named | None]:
    """Return the table `[kind.NAME]` of `FILE.toml:NAME`, while its settings are made; `None` for a port.

    Raises:
        SettingsError: the file or its table cannot be used.

    """
    text, colon, name = where.rpartition(":")
    if not (colon and text.endswith(".toml")):
        yield None
        return
    file = Path(text)
    try:
        tables = tomllib.loads(file.read_text(encoding="utf-8"))
        yield Named(file, name, tables, tables[kind][name])
    except KeyError as error:
        raise SettingsError(
            f"{file} has no table of the name {error}, which [{kind}.{name}] needs"
        ) from error
    except OSError as error:
        raise SettingsError(f"{file}: cannot be read: {error.strerror}") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise SettingsError(f"{file}: {error}") from error
