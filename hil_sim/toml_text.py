"""Tables as TOML, for what is written into a robot's file."""

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def table(name: str, values: Mapping[str, Any]) -> str:
    """`[name]` with what is in it, and its sub-tables behind it."""
    return "\n".join(_lines(name, values)) + "\n"


def _lines(name: str, values: Mapping[str, Any]) -> Iterator[str]:
    yield f"[{name}]"
    for key, value in values.items():
        if not isinstance(value, Mapping):
            yield f"{_key(key)} = {_value(value)}"
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield ""
            yield from _lines(f"{name}.{_key(key)}", value)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _text(key)


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{_key(key)} = {_value(one)}' for key, one in value.items())}}}"
    return str(value)  # numbers, and times


def _text(value: str) -> str:
    """Return a basic string.

    JSON's escapes are TOML's, which has one character more that cannot stand there.
    """
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
