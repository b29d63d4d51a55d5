"""The server's file, `server.toml`: which robots, which store, how to record; every error says what to do.

[robots]
exo-01 = "192.0.2.7:7420"

[store]
url = "s3://bucket/prefix"

[recorder]
spool = "/var/lib/gwrms/spool"
upload = "idle"

[[rules]]
task = "falling"
label = "near_fall"
at_least = 0.9
for_ms = 60
"""

import difflib
import os
import re
import tomllib
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

import msgspec
from msgspec import Meta, Struct, field

from gateway.client import Address, BadAddress
from gateway.wording import key_of, plainly
from ml.store import StoreError, default_url
from ml.store.store import checked_url
from server_gui.core.settings.prediction import PredictionSettings, RuleSettings

Table = TypeVar("Table", bound=Struct)
_ROBOT: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


class SettingsError(ValueError):
    """The server's file cannot be used; the message names file, table, key and what to do."""


class Upload(Enum):
    """When what is recorded goes to the store."""

    ALWAYS = "always"  # a batch at a time, as soon as each is full
    IDLE = "idle"  # while no robot sends, or before the spool takes too much of the disk
    MANUAL = "manual"  # when somebody asks: `gwrms cloud upload`


def default_file() -> Path:
    """Under the user's own configuration (XDG base directories)."""
    return _user_folder("XDG_CONFIG_HOME", ".config") / "server.toml"


def default_spool() -> Path:
    """Under the user's own data (XDG base directories)."""
    return _user_folder("XDG_DATA_HOME", ".local/share") / "spool"


class RobotSettings(Struct, frozen=True, forbid_unknown_fields=True):
    """An entry of `[robots]`, which may be just the address."""

    address: str

    @property
    def where(self) -> Address:
        """The address, taken apart."""
        return Address.parse(self.address)


class StoreSettings(Struct, frozen=True, forbid_unknown_fields=True):
    """`[store]`; `shards` and `several_writers` count when the store is first used.

    `compact_h` is how often a collector puts its small files together; 0 leaves that to others.
    """

    url: str = field(default_factory=default_url)
    shards: Annotated[int, Meta(ge=1, le=1000)] = 1
    several_writers: bool = True
    compact_h: Annotated[float, Meta(ge=0, le=8760)] = 1.0

    @property
    def compact_s(self) -> float | None:
        """The same in seconds; None where a collector is not to, or must not: it would be a second writer."""
        return self.compact_h * 3600.0 if self.compact_h and self.several_writers else None


class RecordingSettings(Struct, frozen=True, forbid_unknown_fields=True):
    """`[recorder]`: where data is safe until it is in the store, what is asked of each robot, and how often.

    `rate_hz` 0 records every sample of every source as it comes, instead of a row a tick.
    """

    spool: Path = field(default_factory=default_spool)
    upload: Upload = Upload.ALWAYS
    rate_hz: Annotated[float, Meta(ge=0, le=1000)] = 100.0
    channels: Annotated[tuple[str, ...], Meta(min_length=1)] = ("*",)  # names or globs
    resources_s: Annotated[float, Meta(ge=0.1, le=3600)] = 5.0  # between looks at a robot's computer
    batch_s: Annotated[float, Meta(ge=1, le=3600)] = 60.0  # of recording that go to the store together


class ServerSettings(Struct, frozen=True):
    """The whole file; `robots` by the names that they have in the store."""

    robots: dict[str, RobotSettings] = {}
    store: StoreSettings = field(default_factory=StoreSettings)
    recorder: RecordingSettings = field(default_factory=RecordingSettings)
    prediction: PredictionSettings = field(default_factory=PredictionSettings)
    rules: tuple[RuleSettings, ...] = ()


def load(path: Path | None = None) -> ServerSettings:
    """Read and check the server's file; without `path` the user's own, or the defaults where there is none.

    Raises:
        SettingsError: it is not there, is no TOML, or says something that cannot work.

    """
    file = default_file() if path is None else path
    try:
        document = tomllib.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        if path is None:
            return ServerSettings()
        raise SettingsError(f"{file}: is not there; name the server's file with --config") from error
    except OSError as error:
        raise SettingsError(f"{file}: cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise SettingsError(f"{file}: is no TOML: {error}") from error
    try:
        return _settings(document, file.parent)
    except SettingsError as error:
        raise SettingsError(f"{file}: {error}") from error


def add_robots(settings: ServerSettings, robots: dict[str, str]) -> ServerSettings:
    """Return the same settings with further robots, or other addresses for some; raises `SettingsError`."""
    known = {name: robot.address for name, robot in settings.robots.items()}
    return msgspec.structs.replace(settings, robots=_robots(known | robots))


def name_of(address: str) -> str:
    """Return a name in the store for a robot of which only the address is known."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", address).strip("-.")


def _settings(document: dict[str, Any], folder: Path) -> ServerSettings:
    _check_keys("the file", document, ServerSettings)
    store = _convert("[store]", document.get("store", {}), StoreSettings)
    try:
        store = msgspec.structs.replace(store, url=checked_url(store.url))
    except StoreError as error:
        raise SettingsError(f"[store] url: {error}") from error
    recorder = _convert("[recorder]", document.get("recorder", {}), RecordingSettings)
    spool = folder / recorder.spool.expanduser()
    return ServerSettings(
        _robots(document.get("robots", {})),
        store,
        msgspec.structs.replace(recorder, spool=spool),
        _convert("[prediction]", document.get("prediction", {}), PredictionSettings),
        _rules(document.get("rules", [])),
    )


def _rules(entries: Any) -> tuple[RuleSettings, ...]:
    if not isinstance(entries, list):
        raise SettingsError(
            "[[rules]] is a list of tables: write it with double brackets, once for each rule"
        )
    numbered = enumerate(entries, 1)
    return tuple(_convert(f"[[rules]] number {number}", entry, RuleSettings) for number, entry in numbered)


def _robots(table: Any) -> dict[str, RobotSettings]:
    if not isinstance(table, dict):
        raise SettingsError('[robots] is a table of names: write exo-01 = "HOST:PORT" in it')
    seen: dict[Address, str] = {}
    robots: dict[str, RobotSettings] = {}
    for name, entry in table.items():
        robots[name] = _robot(name, entry)
        other = seen.setdefault(robots[name].where, name)
        if other != name:
            raise SettingsError(
                f"[robots] {name}: {robots[name].where} is {other} already; remove one of them"
            )
    return robots


def _robot(name: str, entry: Any) -> RobotSettings:
    if not _ROBOT.fullmatch(name):
        raise SettingsError(f"[robots] {name!r}: a robot's name is letters, digits, _, . and -")
    where = f"[robots] {name}"
    if isinstance(entry, str):
        entry = {"address": entry}
    if not isinstance(entry, dict):
        raise SettingsError(f'{where}: write "HOST:PORT", or a table with address = "HOST:PORT"')
    robot = _convert(where, entry, RobotSettings)
    try:
        return msgspec.structs.replace(robot, address=str(robot.where))
    except BadAddress as error:
        raise SettingsError(f"{where}: {error}") from error


def _convert(where: str, table: Any, kind: type[Table]) -> Table:
    if not isinstance(table, dict):
        raise SettingsError(f"{where} is a table, not {table!r}")
    _check_keys(where, table, kind)
    try:
        return msgspec.convert(table, kind, dec_hook=_path)
    except msgspec.ValidationError as error:
        key = key_of(error)
        place = where if key else f"{where}:"
        raise SettingsError(f"{place} {plainly(error)}{_choices(kind, key)}") from error


def _path(_kind: type, value: Any) -> Path:
    if not isinstance(value, str) or not value:
        raise ValueError(f"expected a folder, got {value!r}")
    return Path(value)


def _choices(kind: type[Struct], key: str) -> str:
    """What an enumeration allows."""
    found = next((known.type for known in msgspec.structs.fields(kind) if known.name == key), None)
    if not (isinstance(found, type) and issubclass(found, Enum)):
        return ""
    return f"; allowed are {', '.join(one.value for one in found)}"


def _check_keys(where: str, table: dict[str, Any], kind: type[Struct]) -> None:
    fields = msgspec.structs.fields(kind)
    allowed = [known.name for known in fields]
    for key in table:
        if key not in allowed:
            close = difflib.get_close_matches(key, allowed, n=1)
            hint = f"did you mean {close[0]!r}? " if close else ""
            raise SettingsError(f"{where} has an unknown key {key!r}: {hint}allowed are {', '.join(allowed)}")
    for known in fields:
        if known.required and known.name not in table:
            raise SettingsError(f"{where} lacks the key {known.name!r}")


def _user_folder(variable: str, usual: str) -> Path:
    folder = os.environ.get(variable)
    return (Path(folder) if folder else Path.home() / usual) / "gwrms"
