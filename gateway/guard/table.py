"""The guard's rules as a table in Markdown, for people; drawn from `WATCHES`, and needed by no gateway."""

import typing
from collections.abc import Iterator
from typing import Any

from msgspec import NODEFAULT, Meta
from msgspec.structs import FieldInfo, fields

from gateway.config.guard import WATCHES
from gateway.config.guard_rules import UNIT, GuardRule

_COMMON = frozenset(field.name for field in fields(GuardRule))


def table() -> str:
    """One row a rule; a key that is needed is bold, what stands behind one is its unit and its default."""
    lines = ["| `watch` | of each | trips when | keys |", "|---|---|---|---|"]
    for name, watch in WATCHES.items():
        keys = ", ".join(_key(field, watch.unit) for field in fields(watch.rule) if field.name not in _COMMON)
        lines.append(f"| `{name}` | {', '.join(watch.kinds)} | {watch.trips} | {keys} |")
    return "\n".join(lines)


def _key(field: FieldInfo, unit: str) -> str:
    name = f"**`{field.name}`**" if field.required else f"`{field.name}`"
    told = [word.replace(UNIT, unit) for word in _descriptions(field.type)]
    if field.default not in (NODEFAULT, None, (), 0.0) and not isinstance(field.default, str):
        told.append(f"0x{field.default:03X}" if isinstance(field.default, int) else f"{field.default:g}")
    return f"{name} ({'; '.join(told)})" if told else name


def _descriptions(type_: Any) -> Iterator[str]:
    """Yield the descriptions in a type's annotations, at any depth."""
    for argument in typing.get_args(type_):
        if isinstance(argument, Meta):
            if argument.description is not None:
                yield argument.description
        else:
            yield from _descriptions(argument)
