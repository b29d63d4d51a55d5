"""Everything that is known of one object, in lines for people."""

import time
from collections.abc import Iterator
from typing import Final

from gateway.units import Unit, with_minus
from gateway.wire.dictionary import ObjectInfo
from gateway.wire.parameter import ParameterInfo
from server_gui.core.objects.forms import for_reading, forms
from server_gui.core.objects.reading import ReadValue
from server_gui.core.objects.rows import Compared, limits

LONGEST: Final = 2000  # letters of a value that are shown
IN_ONE_LINE: Final = ("Decimal", "Hex", "Binary", "Length")


def facts(
    info: ObjectInfo,
    compared: Compared,
    parameter: ParameterInfo | None,
    unit: Unit | None,
    refused: str,
    *,
    is_linked: bool,
) -> list[tuple[str, str]]:
    """Title and text each; `parameter` is one that can be changed, in `unit`, unless it is `refused`."""
    held = compared.held.get((compared.component, info.object))
    return [
        ("Holds", _holds(info, held, is_linked=is_linked)),
        *_notations(info, held),
        *_as_parameter(held, parameter, unit),
        *_beside(info, compared),
        *_named("Parameter", info.parameter or ""),
        *_named("Not changed here", refused),
        *_named("Released by, in robot.toml", f"\n{info.release}" if info.release else ""),
        ("Type", " · ".join(_kind(info))),
    ]


def _holds(info: ObjectInfo, held: ReadValue | None, *, is_linked: bool) -> str:
    if held is None:
        return "not read yet" if is_linked else "not read: the robot is not linked"
    now_ns = time.monotonic_ns()
    said = held.told.problem or for_reading(info, held.told.words[:LONGEST])
    is_now = is_linked and not held.is_old(now_ns)
    return said if is_now else f"{said}   (OLD: read {held.age_s(now_ns):.0f} s ago)"


def _notations(info: ObjectInfo, held: ReadValue | None) -> Iterator[tuple[str, str]]:
    found = [] if held is None or held.told.problem is not None else forms(info, held.told)
    numbers = [text for title, text in found if title in IN_ONE_LINE]
    if numbers:
        yield ", ".join(title for title, _ in found if title in IN_ONE_LINE), with_minus(" · ".join(numbers))
    for title, text in found:
        if title not in IN_ONE_LINE:
            yield title, text if len(text) <= LONGEST else f"{text[:LONGEST]} … {len(text)} letters"


def _kind(info: ObjectInfo) -> Iterator[str]:
    yield f"{info.type}, {info.access}"
    if limits(info):
        yield f"limits {limits(info)}"
    if info.unit:
        yield info.unit
    if info.pdos:
        yield f"in {', '.join(info.pdos)} by the EDS"


def _as_parameter(
    held: ReadValue | None, parameter: ParameterInfo | None, unit: Unit | None
) -> Iterator[tuple[str, str]]:
    value = None if held is None or held.told.problem is not None else held.told.value
    if parameter is not None and unit is not None and isinstance(value, int | float) and unit.symbol:
        yield "As parameter", f"{unit.editable(value * parameter.scale)} {unit.symbol}"


def _beside(info: ObjectInfo, compared: Compared) -> Iterator[tuple[str, str]]:
    other = compared.other(info)
    if other is not None:
        mark = "≠ " if compared.differs(info) else ""
        yield compared.title, f"{mark}{for_reading(info, str(other)[:LONGEST])}"


def _named(title: str, text: str) -> Iterator[tuple[str, str]]:
    if text:
        yield title, text
