"""Comparison of a file's parameters with a robot's, with one verdict each."""

from collections.abc import Iterable, Iterator, Mapping
from enum import StrEnum

from msgspec import Struct

from gateway.coding import Coding, CodingError, Limit, Number, broken_limit, coding_of, text
from gateway.wire.parameter import ParameterInfo, ParameterValue


class ComparisonVerdict(StrEnum):
    """Effect of applying the file on one parameter."""

    SAME = "same"
    DIFFERENT = "different"  # and may be written
    READ_ONLY = "read-only"  # different, and may not
    OUT_OF_LIMITS = "out of limits"
    TOO_FAR = "too far at once"
    UNREADABLE = "unreadable"
    NOT_ON_ROBOT = "not on the robot"
    NOT_IN_FILE = "not in the file"


# What a file is no longer the same for, what cannot be brought about, and what no leaving out can help.
UNLIKE = frozenset(ComparisonVerdict) - {ComparisonVerdict.SAME, ComparisonVerdict.NOT_IN_FILE}
CANNOT_CHANGE = frozenset({ComparisonVerdict.READ_ONLY, ComparisonVerdict.NOT_ON_ROBOT})
REFUSED = frozenset(
    {ComparisonVerdict.OUT_OF_LIMITS, ComparisonVerdict.TOO_FAR, ComparisonVerdict.UNREADABLE}
)


_BROKEN: Mapping[Limit, tuple[ComparisonVerdict, str]] = {
    Limit.MIN: (ComparisonVerdict.OUT_OF_LIMITS, "below"),
    Limit.MAX: (ComparisonVerdict.OUT_OF_LIMITS, "above"),
    Limit.MAX_STEP: (ComparisonVerdict.TOO_FAR, "at most"),
}


class Row(Struct, frozen=True):
    """One parameter: the file's value and the robot's, each as the device would hold it."""

    name: str
    unit: str
    file: Number | None
    robot: Number | None
    verdict: ComparisonVerdict
    why: str = ""


def compare(
    wanted: Mapping[str, Number],
    infos: Mapping[str, ParameterInfo],
    held: Mapping[str, ParameterValue],
) -> list[Row]:
    """Every parameter of the file in its order, then those of the same components that it does not name."""
    rows = [_row(name, value, infos.get(name), held.get(name)) for name, value in wanted.items()]
    return [*rows, *(_not_in_file(info, held.get(info.name)) for info in left_out(wanted, infos.values()))]


def _row(name: str, value: Number, info: ParameterInfo | None, held: ParameterValue | None) -> Row:
    if info is None:
        return Row(name, "", value, None, ComparisonVerdict.NOT_ON_ROBOT)
    if held is None or held.value is None:
        why = info.problem or (held.problem if held is not None else None) or "it was not read"
        return Row(name, info.unit, value, None, ComparisonVerdict.UNREADABLE, why)
    coding = coding_of(info.type, info.scale)
    if coding is None:
        return Row(name, info.unit, value, held.value, ComparisonVerdict.UNREADABLE, "its type is not known")
    try:
        data = coding.encode(value)
    except CodingError as error:
        return Row(name, info.unit, value, held.value, ComparisonVerdict.OUT_OF_LIMITS, str(error))
    stored = coding.decode(data)
    if data == coding.encode(held.value):
        return Row(name, info.unit, stored, held.value, ComparisonVerdict.SAME)
    verdict, why = next(_objections(info, coding, stored, held.value), (ComparisonVerdict.DIFFERENT, ""))
    return Row(name, info.unit, stored, held.value, verdict, why)


def _objections(
    info: ParameterInfo, coding: Coding, stored: Number, held: Number
) -> Iterator[tuple[ComparisonVerdict, str]]:
    """Yield why the robot would refuse to change it, the most lasting reason first."""
    if info.read_only is not None:
        yield ComparisonVerdict.READ_ONLY, info.read_only
    broken = broken_limit(info, coding, stored, held)
    if broken is not None:
        verdict, word = _BROKEN[broken]
        yield verdict, f"{word} {text(getattr(info, broken))}"


def _not_in_file(info: ParameterInfo, held: ParameterValue | None) -> Row:
    return Row(
        info.name, info.unit, None, None if held is None else held.value, ComparisonVerdict.NOT_IN_FILE
    )


def left_out(wanted: Mapping[str, Number], infos: Iterable[ParameterInfo]) -> list[ParameterInfo]:
    """Return writable parameters of the same components that the file does not name."""
    infos = tuple(infos)
    components = {info.component for info in infos if info.name in wanted}
    return [
        info
        for info in infos
        if info.component in components and info.name not in wanted and info.read_only is None
    ]
