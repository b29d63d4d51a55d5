"""Filters of a trace's lines: by node, by service, by object."""

import fnmatch
import functools
import re
from collections.abc import Callable, Iterator, Sequence

from drivers.errors import SettingsError
from drivers.trace.decoding import DecodedFrame, FrameKind
from drivers.trace.devices import Device

Filter = Callable[[DecodedFrame], bool]
_OBJECT = re.compile(r"(?:0x([0-9a-f]{4})|([0-9a-f]{4})h)(?::(?:0x)?([0-9a-f]{1,2}))?", re.IGNORECASE)


def by_node(words: Sequence[str], all_: Sequence[Device], on: Callable[[str], Sequence[Device]]) -> Filter:
    """Return lines of these nodes, by number or name, and NMT commands to them; raises `SettingsError`.

    `all_` are the devices that may be named, `on` tells those of an interface.
    """
    for word in words:
        _check(word, all_)
    nodes_of = functools.cache(lambda interface: frozenset(_nodes(words, on(interface))))

    def wanted(line: DecodedFrame) -> bool:
        nodes = nodes_of(line.captured.interface)
        if line.kind is FrameKind.NMT and len(line.captured.data) == 2:
            return line.captured.data[1] in nodes | {0}
        return line.node_id in nodes

    return wanted


def _nodes(words: Sequence[str], devices: Sequence[Device]) -> Iterator[int]:
    for word in words:
        if word.isdecimal():
            yield int(word)
        yield from (device.node_id for device in devices if word in device.name.split("/"))


def _check(word: str, devices: Sequence[Device]) -> None:
    if word.isdecimal():
        if not 0 < int(word) <= 127:
            raise SettingsError(f"--node {word}: a node id is from 1 to 127")
    elif not any(word in device.name.split("/") for device in devices):
        names = ", ".join(device.name for device in devices) or "none, give --robot"
        raise SettingsError(f"--node {word}: no device has that name; known are {names}")


def by_kind(words: Sequence[str]) -> Filter:
    """Return lines of these services; raises `SettingsError`."""
    names = [name.strip().lower() for word in words for name in word.split(",")]
    unknown = [name for name in names if name not in tuple(FrameKind)]
    if unknown:
        raise SettingsError(f"--kind {', '.join(unknown)}: there are {', '.join(FrameKind)}")
    kinds = frozenset(map(FrameKind, names))
    return lambda line: line.kind in kinds


def by_object(words: Sequence[str]) -> Filter:
    """Return lines about these objects: 0x6041, 6041h:00, or a pattern of their names, as *position*."""
    matches = [_matching(word) for word in words]

    def wanted(line: DecodedFrame) -> bool:
        objects = {(value.index, value.subindex): value.name for value in line.values}
        if line.about is not None:
            objects.setdefault(line.about, None)
        return any(match(*key, name) for key, name in objects.items() for match in matches)

    return wanted


def _matching(word: str) -> Callable[[int, int, str | None], bool]:
    found = _OBJECT.fullmatch(word)
    if found is None:
        pattern = word.lower()
        return lambda _index, _subindex, name: name is not None and fnmatch.fnmatch(name.lower(), pattern)
    wanted_index = int(found[1] or found[2], 16)
    wanted_subindex = None if found[3] is None else int(found[3], 16)
    return lambda index, subindex, _name: index == wanted_index and wanted_subindex in (None, subindex)
