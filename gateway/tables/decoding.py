"""Tables to structs; of those that cannot be made, every mistake, key by key."""

import functools
import math
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from typing import Annotated, Any, Final, Literal, TypeVar, Union

import msgspec
from msgspec import Meta, Struct, ValidationError

from gateway.decode_errors import key_of, said
from gateway.tables.finding import Finding, meant, unknown

S = TypeVar("S", bound=Struct)
Table = Mapping[str, Any]

# Which unit a key is in → what the likely mistake is called, and how much less it is.
_UNITS: Final[Mapping[str, tuple[str, str, float]]] = {
    "rad": ("in rad", "°", math.pi / 180.0),
    "s": ("in seconds", " ms", 1e-3),
    "bit/s": ("in bit/s", " kbit/s", 1e3),
    "": ("from 0 to 1", " %", 1e-2),
}
UNIT: Final = "unit"  # of a key, in the `extra` of its `Meta`


class Decoding:
    """Makes structs; `findings` are the mistakes so far."""

    def __init__(self, dec_hook: Callable[[type, Any], Any] | None = None) -> None:
        self.findings: list[Finding] = []
        self._convert = functools.partial(msgspec.convert, dec_hook=dec_hook)  # types that msgspec lacks

    def complain(self, where: str, key: str, text: str) -> None:
        self.findings.append(Finding(where, key, text))

    def tables(self, document: Table, allowed: Iterable[str]) -> None:
        """Complain about what the file has beside these."""
        names = list(allowed)
        for name, value in document.items():
            if name not in names:
                where, key = (f"[{name}]", "") if isinstance(value, dict | list) else ("the file", name)
                self.complain(where, key, f"is not known: {meant(name, names)}allowed are {', '.join(names)}")

    def struct(self, where: str, table: Any, kind: type[S]) -> S | None:
        """Return the struct that a table means.

        Where something is wrong, as far as the rest goes, or `None`.
        """
        if not isinstance(table, dict):
            listed = isinstance(table, list)
            self.complain(
                where, "", f"is a table{': write single brackets' if listed else f', not {table!r}'}"
            )
            return None
        try:
            made: S = self._convert(table, kind)
        except ValidationError:
            return self._parted(where, table, kind)
        for key in kind.__struct_fields__:
            self._check_finite(where, key, getattr(made, key))
        return made

    def _parted(self, where: str, table: Table, kind: type[S]) -> S | None:
        """Key by key; what can be left out is, where it is wrong."""
        known = {field.encode_name: field for field in msgspec.structs.fields(kind)}
        good = {}
        for key, value in table.items():
            if key not in known:
                self.complain(where, key, f"is not known: {meant(key, known)}allowed are {', '.join(known)}")
            elif self._value(where, key, value, known[key].type):
                good[key] = value
        for key, field in known.items():
            if field.required and key not in table:
                self.complain(where, key, "is missing" + _choices_words(field.type))
        try:
            made: S = self._convert(good, kind)
        except ValidationError as error:
            if all(key in good for key, field in known.items() if field.required):
                self._own(where, error, known)
            return None
        return made

    def _own(self, where: str, error: ValidationError, known: Iterable[str]) -> None:
        """Yield problems of the struct itself: a line each, beginning with the key, if any."""
        for text in said(error).split("\n"):
            key, _, rest = text.partition(" ")
            self.complain(where, *((key, rest) if key in known else ("", text)))

    def _value(self, where: str, key: str, value: Any, kind: Any) -> bool:
        """Return whether it can be the value of a key of this type."""
        before = len(self.findings)
        entry = _struct_of(kind)
        if entry is not None and isinstance(value, list):
            for number, one in enumerate(value, 1):
                self.struct(f"[[{where.strip('[]')}.{key}]] number {number}", one, entry)
            return len(self.findings) == before
        self._check_finite(where, key, value)
        if len(self.findings) > before:
            return False
        try:
            self._convert(value, kind)
        except ValidationError as error:
            parts = list(_parts(value, kind))
            for at, part, part_kind in parts:
                self._value(where, f"{key}{at}", part, part_kind)
            if len(self.findings) == before:
                place = f"{key}{key_of(error)}" if parts else key
                text = said(error).replace("an object", "a table")
                self.complain(where, place, _explained(text, value, kind, key))
        return len(self.findings) == before

    def _check_finite(self, where: str, key: str, value: Any) -> None:
        for at, one in enumerate(value) if isinstance(value, list | tuple) else (("", value),):
            if isinstance(one, float) and not math.isfinite(one):
                place = key if at == "" else f"{key}[{at}]"
                self.complain(where, place, f"{one} is no finite number")


def _explained(text: str, value: Any, kind: Any, key: str) -> str:
    """Explain it, with what is allowed, and what was likely meant."""
    notes = [one for one in _leaves(kind) if isinstance(one, Meta)]
    title = next((one.title for one in notes if one.title), None)
    if title is not None and text.startswith("must have the form"):
        text = f"must be {title}"
    choices = _choices(kind)
    if choices and not text.startswith("must"):
        return unknown(value, choices)
    hint = _hint(text, value, kind, key, notes)
    example = next((one.examples[0] for one in notes if one.examples), None)
    if not hint and example is not None:
        hint = f"such as {toml(example)}"
    return ", ".join(filter(None, [text, hint])) + _choices_words(kind)


def _hint(text: str, value: Any, kind: Any, key: str, notes: list[Meta]) -> str:
    if "list, not a table" in text:
        return f"write [[{key}]], once for each" if _struct_of(kind) else ""
    if "must be a list" in text and not any(one.examples for one in notes):
        return f"write [{toml(value)}]"
    if isinstance(value, str):
        return f"without quotes: {value}" if _fits(value, kind) else ""
    unit = next((one.extra[UNIT] for one in notes if one.extra), "s" if key.endswith("_s") else None)
    if unit is None or not isinstance(value, int | float) or not text.startswith("must be a"):
        return ""
    name, other, factor = _UNITS[unit]
    less = f"{round(value * factor, 4):g}" if factor < 1 else f"{value * factor:.0f}"
    beyond = "at most" in text if factor < 1 else "at least" in text
    return f"{name}: {value:g}{other} is {less}" if beyond else ""


def _fits(value: str, kind: Any) -> bool:
    try:
        return not isinstance(msgspec.convert(value, kind, strict=False), str)
    except ValidationError:
        return False


def toml(value: Any) -> str:
    """Return a value as a file has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    return f"[{', '.join(map(toml, value))}]" if isinstance(value, list | tuple) else str(value)


def _choices_words(kind: Any) -> str:
    found = _choices(kind)
    return f"; allowed are {', '.join(map(str, found))}" if found else ""


def _choices(kind: Any) -> list[object]:
    """Return the members of an enumeration; empty for other types."""
    for one in _leaves(kind):
        if typing.get_origin(one) is Literal:
            return list(typing.get_args(one))
        if isinstance(one, type) and issubclass(one, Enum):
            return [member.value for member in one]
    return []


def _leaves(kind: Any) -> Iterator[Any]:
    """Yield a type, its notes and, of what can be one of several, each."""
    if typing.get_origin(kind) is Annotated:
        inner, *notes = typing.get_args(kind)
        yield from notes
        yield from _leaves(inner)
    elif typing.get_origin(kind) in (Union, types.UnionType):
        for one in typing.get_args(kind):
            yield from _leaves(one)
    else:
        yield kind


def _parts(value: Any, kind: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield the entries of a list or table with their places and types."""
    for one in _leaves(kind):
        origin, arguments = typing.get_origin(one), typing.get_args(one)
        if isinstance(value, dict) and origin is dict:
            yield from ((f".{key}", part, arguments[1]) for key, part in value.items())
        elif isinstance(value, list) and origin in (tuple, list):
            endless = origin is list or Ellipsis in arguments
            if endless or len(arguments) == len(value):
                kinds = [arguments[0]] * len(value) if endless else list(arguments)
                yield from ((f"[{at}]", value[at], kinds[at]) for at in range(len(value)))


def _struct_of(kind: Any) -> type[Struct] | None:
    """Return the struct of a list of structs."""
    for one in _leaves(kind):
        if typing.get_origin(one) in (tuple, list):
            entry = typing.get_args(one)[0]
            if isinstance(entry, type) and issubclass(entry, Struct):
                return entry
    return None
