"""Changes between two sessions: parameters, firmware, EDS, calibration, models, wearer.

What one of the two sessions does not tell is *not recorded*: it is in a list of its own, and never taken for
unchanged.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from enum import StrEnum
from typing import Any, Final, TypeGuard

from msgspec import Struct
from msgspec.structs import replace

from ml.store.labels import wearer
from ml.store.sessions import Session
from ml.store.tables import PREDICTIONS
from server_gui.core.cloud.recordings import Recordings

NOT_RECORDED: Final = "not recorded"
NOT_THERE: Final = "not there"
DIGITS: Final = 6


class ChangeKind(StrEnum):
    """Kind of a difference, in the order of their listing."""

    ROBOT = "robot"
    WEARER = "wearer"
    PARAMETER = "parameter"
    CALIBRATION = "calibration"
    FIRMWARE = "firmware"
    DEVICE = "device"
    EDS = "EDS"
    MODEL = "model"
    LIMITS = "limits"
    GUARD = "guard"
    COMPONENT = "component"
    FILE = "robot.toml"
    SOFTWARE = "software"
    OPERATOR = "operator"


# By section of `Session.setup`.
SECTIONS: Final[Mapping[str, ChangeKind]] = {
    "zero": ChangeKind.CALIBRATION,
    "scale": ChangeKind.CALIBRATION,
    "calibration": ChangeKind.CALIBRATION,
    "firmware": ChangeKind.FIRMWARE,
    "hardware": ChangeKind.DEVICE,
    "vendor": ChangeKind.DEVICE,
    "product": ChangeKind.DEVICE,
    "revision": ChangeKind.FIRMWARE,
    "serial number": ChangeKind.DEVICE,
    "EDS": ChangeKind.EDS,
    "limits": ChangeKind.LIMITS,
    "guard": ChangeKind.GUARD,
    "component": ChangeKind.COMPONENT,
    "robot.toml": ChangeKind.FILE,
}
_TITLES: Final = {
    "zero": "{} zero offset (rad)",
    "scale": "{} rad a count",
    "limits": "{}",
    "guard": "rule {}",
}


class Difference(Struct, frozen=True):
    """One thing that was otherwise; both in words.

    Those of a parameter whose `unit` (SI) is recorded end with it, and `numbers` are its two values.
    """

    kind: ChangeKind
    what: str
    before: str
    after: str
    size: float = 0.0  # of numbers: |after − before| in shares of the larger
    unit: str | None = None
    numbers: tuple[int | float, int | float] | None = None


class Changes(Struct, frozen=True):
    """Differences, the most relevant first; and facts that at least one of the two sessions lacks."""

    differences: tuple[Difference, ...]
    unrecorded: tuple[Difference, ...]
    same: int  # that both tell, and alike


class SessionConfiguration(Struct, frozen=True):
    """A session and what is read of it beside its row: who wore the robot, which models predicted."""

    session: Session
    wearers: frozenset[str]
    models: Mapping[str, str]

    @classmethod
    def of(cls, known: Recordings, session: Session) -> "SessionConfiguration":
        """Read it; raises `StoreError`, `SpoolUnusable`."""
        labelled = (wearer(str(row["label"])) for row in known.labels(session))
        said = {session.wearer, *(name for name in labelled if name)} - {""}
        models: dict[str, set[str]] = {}
        for row in known.rows_of(session, PREDICTIONS):
            models.setdefault(str(row["task"]), set()).add(str(row["model"]))
        served = {task: ", ".join(sorted(found)) for task, found in models.items()}
        return cls(session, frozenset(said), served)


def changes(before: SessionConfiguration, after: SessionConfiguration) -> Changes:
    """Return the differences between two sessions."""
    units = before.session.parameter_units | after.session.parameter_units
    found = [_with_unit(one, units) for pair in _facts(before, after) for one in _compared(*pair)]
    known = [one for one in found if NOT_RECORDED not in (one.before, one.after)]
    differ = [one for one in known if one.before != one.after]
    order = list(ChangeKind)
    differ.sort(key=lambda one: (order.index(one.kind), -one.size, one.what))
    unrecorded = [one for one in found if NOT_RECORDED in (one.before, one.after)]
    return Changes(tuple(differ), tuple(_gathered(unrecorded)), len(known) - len(differ))


Facts = Mapping[str, Any]
_Pair = tuple[
    ChangeKind, str, Facts, Facts, bool
]  # kind, title, of both, and whether what is missing was not there


def _facts(before: SessionConfiguration, after: SessionConfiguration) -> Iterator[_Pair]:
    one, other = before.session, after.session
    yield ChangeKind.ROBOT, "{}", {"name": one.robot}, {"name": other.robot}, False
    worn: list[Facts] = [{"wearer": ", ".join(sorted(it.wearers)) or None} for it in (before, after)]
    yield ChangeKind.WEARER, "{}", worn[0], worn[1], False
    yield ChangeKind.PARAMETER, "{}", one.parameters, other.parameters, False
    sections = dict.fromkeys([*(_sections(one.setup)), *SECTIONS, *(_sections(other.setup))])
    for section in sections:
        if section in SECTIONS:
            kind, title = SECTIONS[section], _TITLES.get(section, f"{{}} {section}")
            yield (
                kind,
                title,
                _part(one.setup, section),
                _part(other.setup, section),
                bool(one.setup and other.setup),
            )
    yield ChangeKind.MODEL, "model of {}", before.models, after.models, False
    yield ChangeKind.SOFTWARE, "{}", one.versions, other.versions, False
    yield (
        ChangeKind.OPERATOR,
        "{}",
        {"operator": one.operator or None},
        {"operator": other.operator or None},
        False,
    )


def _sections(setup: Facts) -> Iterator[str]:
    return (key.partition("/")[0] for key in setup)


def _part(setup: Facts, section: str) -> Facts:
    return {key.partition("/")[2]: value for key, value in setup.items() if key.partition("/")[0] == section}


def _compared(
    kind: ChangeKind, title: str, before: Facts, after: Facts, are_told: bool
) -> Iterator[Difference]:
    """Yield the differences of a section. `are_told`: both sessions have a configuration."""
    whole = are_told and kind in (ChangeKind.COMPONENT, ChangeKind.GUARD, ChangeKind.LIMITS)
    if not before and not after and not whole:
        if kind is not ChangeKind.OPERATOR:
            of_devices = kind in (ChangeKind.FIRMWARE, ChangeKind.DEVICE)
            what = title.removeprefix("{} ") if of_devices else str(kind)
            yield Difference(kind, what, NOT_RECORDED, NOT_RECORDED)
        return
    missing = NOT_THERE if whole else NOT_RECORDED
    for name in dict.fromkeys([*before, *after]):
        old, new = before.get(name), after.get(name)
        said = [missing if value is None else _said(value) for value in (old, new)]
        if said[0] == said[1] and old != new:  # alike in few digits only: not the same
            said = [repr(value) for value in (old, new)]
        numbers = (old, new) if _is_number(old) and _is_number(new) else None
        yield Difference(kind, title.format(name), said[0], said[1], _size(old, new), numbers=numbers)


def _with_unit(one: Difference, units: Mapping[str, str]) -> Difference:
    """Return it with its unit, where it is of a parameter that has one."""
    if one.kind is not ChangeKind.PARAMETER or one.what not in units or one.numbers is None:
        return one
    unit = units[one.what]
    before, after = (f"{said} {unit}".rstrip() for said in (one.before, one.after))
    return replace(one, before=before, after=after, unit=unit)


def _said(value: object) -> str:
    return f"{value:.{DIGITS}g}" if isinstance(value, float) else str(value)


def _is_number(value: object) -> TypeGuard[int | float]:
    return isinstance(value, int | float)


def _size(old: object, new: object) -> float:
    if not _is_number(old) or not _is_number(new) or old == new:
        return 0.0
    share = abs(new - old) / max(abs(new), abs(old))
    return share if math.isfinite(share) else 1.0


def _gathered(found: Iterable[Difference]) -> Iterator[Difference]:
    """Yield a line a kind where nothing of it was recorded on a side, instead of one for each joint."""
    by_kind: dict[tuple[ChangeKind, bool, bool], list[Difference]] = {}
    for one in found:
        sides = (one.before == NOT_RECORDED, one.after == NOT_RECORDED)
        by_kind.setdefault((one.kind, *sides), []).append(one)
    for (kind, is_old, is_new), rows in by_kind.items():
        if len(rows) == 1 or (is_old and is_new):
            yield from dict.fromkeys(rows)
            continue
        count = f"recorded of {len(rows)}"
        yield Difference(
            kind, str(kind), NOT_RECORDED if is_old else count, NOT_RECORDED if is_new else count
        )


def not_known(found: Changes) -> list[str]:
    """Return in words what at least one of the two does not tell: first what neither does."""
    neither = [one.what for one in found.unrecorded if one.before == one.after]
    said = [f"not recorded in either: {', '.join(neither)}"] if neither else []
    for side, told in (("before", "after"), ("after", "before")):
        rows = [one for one in found.unrecorded if getattr(one, side) == NOT_RECORDED]
        known = [f"{one.what} ({getattr(one, told)} {told})" for one in rows if one.before != one.after]
        said += [f"not recorded {side}: {', '.join(known)}"] if known else []
    return said
