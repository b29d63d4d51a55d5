"""Meaning of a type in words, for people who write a value."""

import enum
import functools
import operator
import types
import typing
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Union

from msgspec import Meta, Raw, Struct, UnsetType

NONE: Final = type(None)
_PLAIN: Final[Mapping[Any, str]] = {
    str: "text",
    int: "integer",
    float: "number",
    bool: "`true` or `false`",
    Path: "path",
    Any: "anything",
    Raw: "anything",
    NONE: "`null`",
}
_PATTERNS: Final[Mapping[str, str]] = {
    r"^0x[0-9A-Fa-f]{4}:(0x[0-9A-Fa-f]{1,2}|[0-9]{1,3})$": "such as `0x6072:0`: index and sub-index",
    r"^0x[0-9A-Fa-f]{1,4}$": "such as `0x2310`",
}


def kind(type_: Any) -> str:
    """A type in words; a struct is a link to where it is described."""
    if type_ in _PLAIN:
        return _PLAIN[type_]
    origin, arguments = typing.get_origin(type_), typing.get_args(type_)
    if origin is Annotated:
        return _bounded(kind(arguments[0]), [one for one in arguments[1:] if isinstance(one, Meta)])
    if origin is Literal:
        return _choice(arguments)
    if origin in (Union, types.UnionType):
        return _either(arguments)
    if origin in (list, tuple):
        return _sequence(origin, arguments)
    if origin is dict:
        return f"table of names to {kind(arguments[1])}"
    if isinstance(type_, type) and issubclass(type_, enum.Enum):
        return _choice([one.value for one in type_])
    if isinstance(type_, type) and issubclass(type_, Struct):
        return f"[{type_.__name__}](#{type_.__name__.lower()})"
    return str(type_)


def without_none(type_: Any) -> Any:
    """Return the type of a value that is given: `None` only stands for its absence."""
    if typing.get_origin(type_) is Annotated:
        inner, *notes = typing.get_args(type_)
        return Annotated[without_none(inner), *notes]
    if typing.get_origin(type_) in (Union, types.UnionType):
        left = [one for one in typing.get_args(type_) if one not in (NONE, UnsetType)]
        return functools.reduce(operator.or_, left)
    return type_


def parts(type_: Any) -> Iterator[Any]:
    """Yield the type itself, and all that it is made of."""
    yield type_
    for argument in typing.get_args(type_):
        yield from parts(argument)


def _choice(values: typing.Iterable[Any]) -> str:
    return ", ".join(f'`"{value}"`' if isinstance(value, str) else f"`{value}`" for value in values)


def _either(arguments: tuple[Any, ...]) -> str:
    given = [one for one in arguments if one is not UnsetType]
    if {int, float} <= set(given):
        given.remove(int)
    return " or ".join(dict.fromkeys(kind(one) for one in given))


def _sequence(origin: type, arguments: tuple[Any, ...]) -> str:
    if origin is list or Ellipsis in arguments:
        return f"list of {kind(arguments[0])}"
    kinds = [kind(one) for one in arguments]
    if len(set(kinds)) == 1:
        return f"{len(kinds)} times {kinds[0]}"
    return f"[{', '.join(kinds)}]"


def _bounded(inner: str, notes: list[Meta]) -> str:
    for note in notes:
        inner = " ".join([inner, *_bounds(note)])
    return inner


def _bounds(note: Meta) -> Iterator[str]:
    if note.ge is not None and note.le is not None:
        yield f"{note.ge:,} … {note.le:,}"
    elif note.gt is not None and note.le is not None:
        yield f"above {note.gt:,}, up to {note.le:,}"
    elif note.ge is not None:
        yield f"from {note.ge:,}"
    elif note.gt is not None:
        yield f"above {note.gt:,}"
    if note.multiple_of is not None:
        yield f"in steps of {note.multiple_of:,}"
    if note.max_length is not None:
        yield f"of at most {note.max_length} characters"
    if note.min_length is not None:
        yield "(not empty)"
    if note.pattern is not None:
        yield _PATTERNS.get(note.pattern, f"like `{note.pattern}`".replace("|", "\\|"))
