"""Sources of streams and snapshots: components' samples, and the selected channels."""

import fnmatch
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from msgspec import UNSET

from drivers.latest import Latest, Listener
from drivers.samples import Channel
from gateway.wire.component import ChannelInfo
from gateway.wire.framing import ErrorKind, refuse
from gateway.wire.limits import GLOBS, NAME_OR_GLOB_LENGTH, NAMES, WILD_CARDS

_WILD = frozenset("*?[")


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


class Wanted:
    """Set of names and globs, with lookups whose time does not grow with their number.

    Raises:
        RpcError: bad_params, where there are more of them than anybody needs.

    """

    def __init__(self, globs: Sequence[str] | None) -> None:
        named = globs or ()
        if len(named) > NAMES:
            raise refuse(
                ErrorKind.BAD_PARAMS,
                f"{len(named)} names and globs, and {NAMES} are the most: use a glob such as left_*",
            )
        for one in named:
            if len(one) > NAME_OR_GLOB_LENGTH:
                why = f"a name or glob has {len(one)} characters, and {NAME_OR_GLOB_LENGTH} are the most"
                raise refuse(ErrorKind.BAD_PARAMS, f"{why}: {one[:20]!r}…")
        patterns = dict.fromkeys(one for one in named if not _WILD.isdisjoint(one))
        for one in patterns:
            if not one.isascii():
                raise refuse(
                    ErrorKind.BAD_PARAMS, f"the glob {one!r} has characters beyond ASCII: use others"
                )
            if sum(map(one.count, _WILD)) > WILD_CARDS:
                raise refuse(
                    ErrorKind.BAD_PARAMS, f"the glob {one!r} has more than {WILD_CARDS} of * ? and ["
                )
        if len(patterns) > GLOBS:
            raise refuse(ErrorKind.BAD_PARAMS, f"a request may have {GLOBS} globs, not {len(patterns)}")
        self._all = globs is None
        self._exact = dict.fromkeys(named)
        self._patterns = {one: re.compile(fnmatch.translate(one)) for one in patterns}

    def __contains__(self, name: str) -> bool:
        return self._all or name in self._exact or any(one.match(name) for one in self._patterns.values())

    def meaningless(self, names: Collection[str]) -> Iterator[str]:
        """Yield those of its names and globs that mean none of these."""
        for one in self._exact:
            pattern = self._patterns.get(one)
            if one not in names and (pattern is None or not any(map(pattern.match, names))):
                yield one


def matches(name: str, globs: Sequence[str] | None) -> bool:
    """Return whether a glob means this name; no globs mean every name. For many names: `Wanted`."""
    return globs is None or any(fnmatch.fnmatchcase(name, glob) for glob in globs)


def whole(source: Source) -> Selection:
    """Every channel of a source."""
    return Selection(source, tuple(range(len(source.channels))))


def narrow(selections: Iterable[Selection], globs: Sequence[str] | None) -> list[Selection]:
    """Return the selections narrowed by the globs, without empty ones."""
    narrowed, wanted = [], Wanted(globs)
    for one in selections:
        indices = tuple(index for index in one.indices if one.source.channels[index].name in wanted)
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
        RpcError: unknown_name; unavailable where the component is absent; bad_params, see `Wanted`.

    """
    for glob in Wanted(globs).meaningless(dict.fromkeys(names)):
        component = glob.partition(".")[0]
        if absent and component in absent:
            raise refuse(ErrorKind.UNAVAILABLE, f"{glob}: {absent[component]}", component=component)
        raise refuse(
            ErrorKind.UNKNOWN_NAME, f"there is no {what} {glob!r}; robot.describe lists what there is"
        )


def channel_info(channel: Channel) -> ChannelInfo:
    """Return a channel as `robot.describe` shows it; JSON's keys are text."""
    enum = UNSET if channel.enum is None else {str(number): word for number, word in channel.enum.items()}
    return ChannelInfo(channel.name, channel.unit, channel.component, channel.quantity, enum)
