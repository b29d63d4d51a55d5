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

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

import msgspec
from msgspec import Meta, Struct, field

from gateway.client import Address, BadAddress
from gateway.client.keys import checked_pin
from gateway.tables.decoding import Decoding
from gateway.tables.finding import Finding, Told, in_order, lines, mistakes, told, warning
from gateway.tables.reading import Unreadable, read
from ml.store import StoreError
from ml.store.url import checked_url, default_url
from server_gui.core.settings.prediction import DANGER, Action, PredictionSettings, RuleSettings

Table = TypeVar("Table", bound=Struct)
_LIKELY: Final = 0.5  # that something is so rather than not
_ROBOT: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")


class SettingsError(ValueError):
    """The server's file cannot be used; the message names file, table, key and what to do."""


class Upload(Enum):
    """Time of uploads."""

    ALWAYS = "always"  # a batch at a time, as soon as each is full
    IDLE = "idle"  # while no robot sends, or before the spool takes too much of the disk
    MANUAL = "manual"  # when somebody asks: `gwrms cloud upload`


def default_file() -> Path:
    """Return the file below the user's own configuration (XDG base directories)."""
    return _user_folder("XDG_CONFIG_HOME", ".config") / "server.toml"


def default_spool() -> Path:
    """Return the folder below the user's own data (XDG base directories)."""
    return _user_folder("XDG_DATA_HOME", ".local/share") / "spool"


def exports_folder() -> Path:
    """Beside that: what was exported by this user on this computer."""
    return default_spool().with_name("exports")


class RobotSettings(Struct, frozen=True, forbid_unknown_fields=True):
    """An entry of `[robots]`: a table, or just the address."""

    address: str  # HOST:PORT
    pin: str | None = None  # of the robot's key; `gwrms pair` adds it

    def __post_init__(self) -> None:
        if self.pin is not None:
            checked_pin(self.pin)

    @property
    def pinned(self) -> dict[str, str]:
        """Its pin as it stands in the file."""
        return {} if self.pin is None else {"pin": self.pin}

    @property
    def where(self) -> Address:
        """The address, taken apart."""
        return replace(Address.parse(self.address), pin=self.pin)


class StoreSettings(Struct, frozen=True, forbid_unknown_fields=True):
    """`[store]`: the store; `shards` and `several_writers` take effect when it is created."""

    url: str = field(default_factory=default_url)  # `file:///FOLDER` or `s3://BUCKET/PREFIX`
    shards: Annotated[int, Meta(ge=1, le=1000)] = 1  # number of telemetry tables
    several_writers: bool = True  # several collectors, or a collector and its compaction, write to it
    compact_h: Annotated[float, Meta(ge=0, le=8760)] = 1.0  # period of merging small files; 0: never

    @property
    def compact_s(self) -> float | None:
        """The same in seconds; None where a collector is not to, or must not: it would be a second writer."""
        return self.compact_h * 3600.0 if self.compact_h and self.several_writers else None


class RecordingSettings(Struct, frozen=True, forbid_unknown_fields=True):
    """`[recorder]`: the spool, the recorded data, and the uploads."""

    spool: Path = field(default_factory=default_spool)  # folder of data that is not in the store yet
    upload: Upload = Upload.ALWAYS  # time of uploads
    rate_hz: Annotated[float, Meta(ge=0, le=1000)] = 100.0  # rows a second; 0: every sample as it comes
    channels: Annotated[tuple[str, ...], Meta(min_length=1)] = ("*",)  # names or globs
    resources_s: Annotated[float, Meta(ge=0.1, le=3600)] = 5.0  # period of measuring a robot's computer
    batch_s: Annotated[float, Meta(ge=1, le=3600)] = 60.0  # length of recording in one upload


class ServerSettings(Struct, frozen=True):
    """The whole file; `robots` by the names that they have in the store."""

    robots: dict[str, RobotSettings] = {}
    store: StoreSettings = field(default_factory=StoreSettings)
    recorder: RecordingSettings = field(default_factory=RecordingSettings)
    prediction: PredictionSettings = field(default_factory=PredictionSettings)
    rules: tuple[RuleSettings, ...] = ()
    promoters: dict[str, str] = {}


@dataclass(frozen=True, slots=True)
class Examined:
    """A server's file with what is wrong with it, or likely is; `settings` where it can be used."""

    settings: ServerSettings | None
    findings: list[Finding]


def load(path: Path | None = None) -> ServerSettings:
    """Read and check the server's file; without `path` the user's own, or the defaults where there is none.

    Raises:
        SettingsError: it is not there, is no TOML, or says something that cannot work.

    """
    file = default_file() if path is None else path
    if path is None and not file.exists():
        return ServerSettings()
    found = examine(file)
    if found.settings is None:
        raise SettingsError(lines(file, mistakes(found.findings)))
    return found.settings


def examine(file: Path) -> Examined:
    """Read the server's file; whatever is wrong with it is told, not only the first thing."""
    if not file.exists():
        missing = Finding("", "", "is not there; name the server's file with --config")
        return Examined(None, [missing])
    try:
        document = read(file)
    except Unreadable as error:
        return Examined(None, [error.finding])
    return examined(file, document)


def examined(file: Path, document: dict[str, Any]) -> Examined:
    """Return the same for what stands in it."""
    reading = _Reading(Decoding(_path))
    settings = reading.settings(document, file.parent)
    findings = in_order([*reading.findings, *_unlikely(settings)], document)
    return Examined(None if mistakes(findings) else settings, findings)


def findings(file: Path, tables: dict[str, Any], *, machine: bool) -> Iterator[Told]:  # noqa: ARG001 - of robots
    """Return the findings of `gwrms check`."""
    return told(examined(file, tables).findings)


def add_robots(settings: ServerSettings, robots: dict[str, str]) -> ServerSettings:
    """Return the same settings with further robots, or other addresses for some; raises `SettingsError`."""
    known = {name: {"address": robot.address} | robot.pinned for name, robot in settings.robots.items()}
    given = {name: known.get(name, {}) | {"address": address} for name, address in robots.items()}
    reading = _Reading(Decoding())
    added = msgspec.structs.replace(settings, robots=reading.robots(known | given))
    if reading.findings:
        raise SettingsError("\n".join(one.words for one in reading.findings))
    return added


def name_of(address: str) -> str:
    """Return a name in the store for a robot of which only the address is known."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", address).strip("-.")


class _Reading:
    """One file's tables, or those of the command line; what is wrong is in `findings`."""

    def __init__(self, decoding: Decoding) -> None:
        self.findings = decoding.findings
        self._decoding = decoding

    def settings(self, document: dict[str, Any], folder: Path) -> ServerSettings:
        """Return the valid parts of the file."""
        self._decoding.tables(document, ServerSettings.__struct_fields__)
        recorder = self._table("recorder", document, RecordingSettings)
        return ServerSettings(
            self.robots(document.get("robots", {})),
            self._store(document),
            msgspec.structs.replace(recorder, spool=folder / recorder.spool.expanduser()),
            self._table("prediction", document, PredictionSettings),
            self._rules(document.get("rules", [])),
            self._promoters(document.get("promoters", {})),
        )

    def _table(self, name: str, document: dict[str, Any], kind: type[Table]) -> Table:
        made = self._decoding.struct(f"[{name}]", document.get(name, {}), kind)
        return kind() if made is None else made

    def _store(self, document: dict[str, Any]) -> StoreSettings:
        store = self._table("store", document, StoreSettings)
        try:
            return msgspec.structs.replace(store, url=checked_url(store.url))
        except StoreError as error:
            self._decoding.complain("[store]", "url", str(error))
            return store

    def _rules(self, entries: Any) -> tuple[RuleSettings, ...]:
        if not isinstance(entries, list):
            text = "is a list of tables: write it with double brackets, once for each rule"
            self._decoding.complain("[[rules]]", "", text)
            return ()
        numbered = enumerate(entries, 1)
        made = (self._decoding.struct(f"[[rules]] number {at}", one, RuleSettings) for at, one in numbered)
        return tuple(rule for rule in made if rule is not None)

    def _promoters(self, table: Any) -> dict[str, str]:
        """`[promoters]`: fingerprints of keys by whose these are."""
        if not isinstance(table, dict):
            self._decoding.complain(
                "[promoters]", "", 'is a table of names: write anna = "SHA-256 of her key"'
            )
            return {}
        found: dict[str, str] = {}
        for name, key in table.items():
            try:
                found[name] = checked_pin("".join(str(key).split()))
            except ValueError:
                text = "is the SHA-256 of a key, 64 hexadecimal digits: gwrms models key says it, on its desk"
                self._decoding.complain("[promoters]", name, text)
        return found

    def robots(self, table: Any) -> dict[str, RobotSettings]:
        """`[robots]`, each with an address of its own."""
        if not isinstance(table, dict):
            self._decoding.complain("[robots]", "", 'is a table of names: write exo-01 = "HOST:PORT" in it')
            return {}
        seen: dict[Address, str] = {}
        robots: dict[str, RobotSettings] = {}
        for name, entry in table.items():
            robot = self._robot(name, entry)
            if robot is None:
                continue
            robots[name] = robot
            other = seen.setdefault(robot.where, name)
            if other != name:
                self._decoding.complain(
                    "[robots]", name, f"{robot.where} is {other} already; remove one of them"
                )
        return robots

    def _robot(self, name: str, entry: Any) -> RobotSettings | None:
        if not _ROBOT.fullmatch(name):
            self._decoding.complain("[robots]", name, "a robot's name is letters, digits, _, . and -")
        if isinstance(entry, str):
            entry = {"address": entry}
        if not isinstance(entry, dict):
            text = 'write "HOST:PORT", or a table with address = "HOST:PORT"'
            self._decoding.complain("[robots]", name, text)
            return None
        robot = self._decoding.struct(f"[robots.{name}]", entry, RobotSettings)
        try:
            return None if robot is None else msgspec.structs.replace(robot, address=str(robot.where))
        except BadAddress as error:
            self._decoding.complain("[robots]", name, str(error))
            return None


def _unlikely(settings: ServerSettings) -> Iterator[Finding]:
    """Yield possible but unlikely settings."""
    if settings.rules and not settings.prediction.enabled:
        yield warning(
            "[prediction]", "enabled", "is false, and without predictions no rule of [[rules]] acts"
        )
    for number, rule in enumerate(settings.rules, 1):
        where = f"[[rules]] number {number}"
        if rule.task == DANGER and not settings.prediction.danger:
            text = "is danger, which is not foreseen before [prediction] has danger = true"
            yield warning(where, "task", text)
        if settings.robots and not any(map(rule.concerns, settings.robots)):
            known = ", ".join(settings.robots)
            yield warning(where, "robot", f"{rule.robot!r} is none of [robots], which are {known}")
        if rule.action is Action.STOP and rule.at_least < _LIKELY:
            text = f"{rule.at_least:g} stops a robot on what is more likely not so"
            yield warning(where, "at_least", text)
        if rule.action is Action.STOP and not settings.promoters:
            text = "stops nothing: [promoters] names nobody whose models it may believe (gwrms docs predict)"
            yield warning(where, "action", text)


def _path(_kind: type, value: Any) -> Path:
    if not isinstance(value, str) or not value:
        raise ValueError(f"must be a folder's path in quotes, not {value!r}")
    if "://" in value:
        raise ValueError(f"must be a folder of this computer, not {value!r}: [store] url is where it ends")
    return Path(value)


def _user_folder(variable: str, usual: str) -> Path:
    folder = os.environ.get(variable)
    return (Path(folder) if folder else Path.home() / usual) / "gwrms"
