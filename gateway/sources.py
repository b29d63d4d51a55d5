"""What streams and snapshots read: sources of samples, and the channels of them that somebody wants."""

import fnmatch
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from msgspec import UNSET

from drivers.latest import Latest, Listener
from drivers.samples import Channel
from gateway.messages import ChannelInfo
from gateway.wire import Kind, refuse


class Source(Protocol):
    """Anything with samples: a component, or the host's own resources."""

    @property
    def name(self) -> str: ...

    @property
    def channels(self) -> tuple[Channel, ...]: ...

    @property
    def latest(self) -> Latest: ...

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with every sample, maybe in another thread; returns how to end it."""


@dataclass(frozen=True, slots=True)
class Selection:
    """Some channels of one source, by their indices in its `channels`."""

    source: Source
    indices: tuple[int, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.source.channels[index].name for index in self.indices)


def matches(name: str, globs: Sequence[str] | None) -> bool:
    """Whether one of the globs means this name; no globs mean every name."""
    return globs is None or any(fnmatch.fnmatchcase(name, glob) for glob in globs)


def whole(source: Source) -> Selection:
    """Every channel of a source."""
    return Selection(source, tuple(range(len(source.channels))))


def narrow(selections: Iterable[Selection], globs: Sequence[str] | None) -> list[Selection]:
    """What the globs leave of the selections; those left empty are gone."""
    narrowed = []
    for one in selections:
        indices = tuple(index for index in one.indices if matches(one.source.channels[index].name, globs))
        if indices:
            narrowed.append(Selection(one.source, indices))
    return narrowed


def merge(selections: Iterable[Selection]) -> list[Selection]:
    """One selection a source, each channel once."""
    merged: dict[str, Selection] = {}
    for one in selections:
        known = merged.get(one.source.name)
        indices = set(one.indices) | set(known.indices if known is not None else ())
        merged[one.source.name] = Selection(one.source, tuple(sorted(indices)))
    return list(merged.values())


def check_globs(
    what: str, names: Iterable[str], globs: Sequence[str] | None, absent: Mapping[str, str] | None = None
) -> None:
    """Refuse a glob that means none of the names.

    `absent` says why components are not there that would otherwise have names.

    Raises:
        RpcError: unknown_name, or unavailable where the component is absent.

    """
    known = tuple(names)
    for glob in globs or ():
        if any(fnmatch.fnmatchcase(name, glob) for name in known):
            continue
        component = glob.partition(".")[0]
        if absent and component in absent:
            raise refuse(Kind.UNAVAILABLE, f"{glob}: {absent[component]}", component=component)
        raise refuse(Kind.UNKNOWN_NAME, f"there is no {what} {glob!r}; robot.describe lists what there is")


def channel_info(channel: Channel) -> ChannelInfo:
    """A channel as `robot.describe` shows it; JSON's keys are text."""
    enum = UNSET if channel.enum is None else {str(number): word for number, word in channel.enum.items()}
    return ChannelInfo(channel.name, channel.unit, channel.component, channel.quantity, enum)
