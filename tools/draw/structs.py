"""A msgspec struct as rows of a table: each key's name, type, default, and what its comment says."""

import enum
import inspect
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from msgspec import NODEFAULT, UNSET, Struct
from msgspec.structs import FieldInfo, fields

from gateway.tables.comments import comments
from tools.draw.kinds import kind, parts, without_none

_ABOVE = re.compile(r"^(?:Result of )?`[^`]+`(?: and `[^`]+`)?[.:;] ?")


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a struct, in words."""

    name: str
    kind: str
    default: str | None  # None: it is required
    meaning: str


def written(struct: type[Struct]) -> Iterator[Key]:
    """Yield the keys of a table that people write: what may be `None` may be left out."""
    said = comments(struct)
    for field in fields(struct):
        meaning = said.get(field.name, "").replace("None: ", "not given: ")
        yield Key(field.encode_name, kind(without_none(field.type)), _default(field), meaning)


def sent(struct: type[Struct]) -> Iterator[Key]:
    """Yield the fields of an object that programs send: what may be `None` is `null`."""
    said = comments(struct)
    for field in fields(struct):
        meaning = said.get(field.name, "").replace("None: ", "null: ")
        yield Key(field.encode_name, kind(field.type), _default(field), meaning)


def docstring(struct: type[Struct]) -> str:
    """Return its docstring, a line a paragraph, without the name that already stands above it."""
    paragraphs = (inspect.getdoc(struct) or "").split("\n\n")
    text = "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
    text = _ABOVE.sub("", text).replace("`None`", "`null`")
    return text[:1].upper() + text[1:]


def mentioned(struct: type[Struct]) -> Iterator[type[Struct]]:
    """Yield the structs that its fields are made of, and theirs."""
    for field in fields(struct):
        for part in parts(field.type):
            if isinstance(part, type) and issubclass(part, Struct):
                yield part
                yield from mentioned(part)


def table(keys: Iterable[Key], first: str = "key") -> str:
    """In Markdown; keys that are required stand first, in bold."""
    lines = [f"| {first} | type | default | meaning |", "|---|---|---|---|"]
    for key in sorted(keys, key=lambda key: key.default is not None):
        name = f"**`{key.name}`**" if key.default is None else f"`{key.name}`"
        lines.append(f"| {name} | {key.kind} | {key.default or ''} | {key.meaning} |")
    return "\n".join(lines)


def _default(field: FieldInfo) -> str | None:
    if field.required:
        return None
    if field.default in (NODEFAULT, UNSET, None, (), ""):
        return ""
    return f"`{_as_toml(field.default)}`"


def _as_toml(value: object) -> str:
    if isinstance(value, enum.Enum):
        value = value.value
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_as_toml, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)
