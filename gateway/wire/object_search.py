"""Search for objects of a device: the same on the robot and at the desk."""

import re
from collections.abc import Callable

_ADDRESS = re.compile(r"0x([0-9a-f]{1,4})(?::([0-9]{1,3}))?")
_RANGE = re.compile(r"0x([0-9a-f]{1,4})\s*(?:-\s*(?:0x([0-9a-f]{1,4}))?|…|\.\.\.)")
_LAST = 0xFFFF

Fits = Callable[[int, int, str], bool]  # index, sub-index, name


def fitting(search: str) -> Fits:
    """Return the function that tells which objects a search selects: see `ObjectListParams`."""
    text = search.strip().lower()
    if text.startswith("0x") and text.endswith("*"):
        prefix = text[2:-1]
        return lambda index, _subindex, _name: f"{index:04x}".startswith(prefix)
    if found := _RANGE.fullmatch(text):
        first, last = int(found[1], 16), int(found[2], 16) if found[2] else _LAST
        return lambda index, _subindex, _name: first <= index <= last
    if found := _ADDRESS.fullmatch(text):
        wanted, member = int(found[1], 16), None if found[2] is None else int(found[2])
        return lambda index, subindex, _name: index == wanted and member in (None, subindex)
    words = text.split()
    return lambda _index, _subindex, name: all(word in name.lower() for word in words)
