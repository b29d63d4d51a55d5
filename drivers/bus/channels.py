"""Objects that the robot's file makes channels: read by PDO where one brings them, else asked for by SDO."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from drivers.bus.fields import Field, Linear, unpacker
from drivers.bus.frames import EXTENDED, FrameHandler
from drivers.bus.lengths import Lengths
from drivers.bus.node import Node
from drivers.bus.pdo import Tpdo
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.settings import ChannelSettings
from drivers.bus.values import decode
from drivers.errors import DeviceAbort, DeviceTimeout
from drivers.latest import Latest
from drivers.samples import Channel
from eds import Description
from eds.datatypes import DATA_TYPES, DataType

Chosen = Mapping[str, ChannelSettings]  # by the channels' quantities
_NUMBERS = ("boolean", "signed", "unsigned", "real")


def channels_of(component: str, chosen: Chosen) -> tuple[Channel, ...]:
    """Return the channels that the robot's file adds to a component, in its order."""
    return tuple(
        Channel(f"{component}.{name}", component, name, one.unit, one.states) for name, one in chosen.items()
    )


@dataclass(frozen=True, slots=True)
class _Source:
    """One object that can be read, and the channel that it becomes."""

    name: str
    channel: int
    settings: ChannelSettings
    code: int  # of its data type

    @property
    def type(self) -> DataType:
        return DATA_TYPES[self.code]

    @property
    def linear(self) -> Linear:
        return Linear(self.settings.scale, self.settings.offset)

    def fits(self, bits: int) -> bool:
        """Return whether so many mapped bits can be its number: a part of it would be another number."""
        return bits == self.type.bits or (self.type.kind == "boolean" and bits > 0)

    def value(self, number: float) -> float | None:
        value = number * self.settings.scale + self.settings.offset
        return value if math.isfinite(value) else None


def objection(settings: ChannelSettings, description: Description) -> str | None:
    """Return why this device has no such channel, in words; `None` if it can have it."""
    variable = description.variable(*settings.address)
    if variable is None:
        return f"{description.path.name} has no object {settings.object}"
    known = DATA_TYPES.get(variable.data_type or 0)
    if known is None or known.kind not in _NUMBERS:
        return f"{settings.object} is no number in {description.path.name}"
    if variable.access_type.lower() == "wo":
        return f"{settings.object} cannot be read, says {description.path.name}"
    return None


class ObjectChannels:
    """Those of one component, from `install` to `forget`; `first` is the index of the first of them."""

    def __init__(
        self, node: Node, description: Description, chosen: Chosen, latest: Latest, first: int = 0
    ) -> None:
        self.short_frames = 0  # or longer: nothing was made of them
        self._node = node
        self._latest = latest
        self._sources: list[_Source] = []
        self._unusable: list[str] = []
        self._lock = threading.RLock()  # values come from two threads
        self._undo: list[Callable[[], None]] = []
        self._expected: dict[str, list[_Source]] = {}  # by who brings them, in words
        self._notes: tuple[str, ...] = ()
        self._refused: dict[int, str] = {}  # by channel, what the device says of its object
        self._installed_ns = 0
        self._plan = 0  # counts what makes values worthless that are still on their way
        for channel, (name, settings) in enumerate(chosen.items(), first):
            self._add(name, channel, settings, description)

    def _add(self, name: str, channel: int, settings: ChannelSettings, description: Description) -> None:
        why, variable = objection(settings, description), description.variable(*settings.address)
        if why is not None or variable is None:
            self._unusable.append(f"{name}: {why}")
        else:
            self._sources.append(_Source(name, channel, settings, variable.data_type or 0))

    def __bool__(self) -> bool:
        """Return whether there is anything to read."""
        return bool(self._sources)

    def install(self, tpdos: Sequence[Tpdo]) -> None:
        """Read them from now on, by these PDOs as the device has them now."""
        with self._lock:
            self.forget()
            plan = self._plan
            self._installed_ns = time.monotonic_ns()
            brought: set[int] = set()
            fresh: set[int] = set()
            for tpdo in tpdos:
                if tpdo.enabled and (found := list(self._mapped(tpdo))):
                    self._follow(plan, tpdo, found)
                    brought |= {source.channel for source, _ in found}
                    fresh |= {source.channel for source, _ in found if tpdo.cyclic}
                    self._expect_change(tpdo, [one for one, _ in found if not one.settings.poll_hz])
            self._poll_those(plan, [one for one in self._sources if one.channel not in fresh])
            self._notes = tuple(
                f"{one.name}: not asked for (poll_hz is 0), and no TPDO brings it"
                for one in self._sources
                if one.channel not in brought and not one.settings.poll_hz
            )

    def forget(self) -> None:
        """Read them no more."""
        with self._lock:
            self._plan += 1
            while self._undo:
                self._undo.pop()()
            self._expected.clear()
            self._refused.clear()
            self._notes = ()

    def problems(self, now_ns: int) -> Iterator[str]:
        """Yield the channels without a value and the reasons, in words with what to check."""
        yield from self._unusable
        yield from self._notes
        with self._lock:
            expected, refused = dict(self._expected), dict(self._refused)
        if now_ns - self._installed_ns <= self._latest.stale_after_ns:
            return
        for bringer, sources in expected.items():
            absent = [one for one in sources if self._latest.read(one.channel, now_ns)[0] is None]
            yield from (f"{one.name}: {refused[one.channel]}" for one in absent if one.channel in refused)
            names = [one.name for one in absent if one.channel not in refused]
            if names:
                yield f"no {' and '.join(names)}: {bringer}"

    def _mapped(self, tpdo: Tpdo) -> Iterator[tuple[_Source, Field]]:
        """Yield the channels that this TPDO carries."""
        for place in tpdo.objects:
            for one in self._sources:
                if one.settings.address == (place.index, place.subindex) and one.fits(place.bits):
                    yield one, Field(one.channel, place.at, place.bits, one.type.kind, one.linear)

    def _follow(self, plan: int, tpdo: Tpdo, found: Sequence[tuple[_Source, Field]]) -> None:
        bus, can_id = self._node.bus, tpdo.cob_id | EXTENDED if tpdo.extended else tpdo.cob_id
        sources = [source for source, _ in found]
        handler = self._handler(plan, tpdo.size, sources, [field for _, field in found])
        bus.subscribe(can_id, handler)
        self._undo.append(partial(bus.unsubscribe, can_id, handler))
        if tpdo.cyclic:
            words = f"TPDO{tpdo.number} (0x{tpdo.cob_id:03X}), which brings it {tpdo.trigger}, does not come"
            self._expected[words] = sources

    def _expect_change(self, tpdo: Tpdo, unasked: list[_Source]) -> None:
        if unasked and not tpdo.cyclic:
            words = f"TPDO{tpdo.number} (0x{tpdo.cob_id:03X}) brings it only {tpdo.trigger}, and poll_hz is 0"
            self._expected[words] = unasked

    def _handler(
        self, plan: int, size: int, sources: Sequence[_Source], fields: Sequence[Field]
    ) -> FrameHandler:
        unpack, indices = unpacker(fields), tuple(one.channel for one in sources)
        lengths = Lengths(size, self._node.remapped)

        def on_frame(stamp_ns: int, data: bytes) -> None:
            if len(data) != lengths.usual and not lengths.fits(stamp_ns, len(data)):
                self.short_frames += 1
                return
            values = [one.value(number) for one, number in zip(sources, unpack(data), strict=True)]
            with self._lock:
                if plan == self._plan:
                    self._latest.update(stamp_ns, indices, tuple(values))

        return on_frame

    def _poll_those(self, plan: int, sources: Iterable[_Source]) -> None:
        by_rate: dict[float, list[_Source]] = {}
        for one in sources:
            if one.settings.poll_hz:
                by_rate.setdefault(one.settings.poll_hz, []).append(one)
        for hz, some in by_rate.items():
            self._undo.append(self._node.worker.repeat(1 / hz, partial(self._poll, plan, deque(some))))
            words = f"the device does not answer the SDO that asks for it {hz:g} times a second"
            self._expected[words] = some

    def _poll(self, plan: int, sources: deque[_Source], sdo: SdoChannel) -> None:
        for _ in range(len(sources)):
            one, asked_ns = sources[0], time.monotonic_ns()
            sources.rotate(-1)
            try:
                number = decode(sdo.upload(*one.settings.address, attempts=1), one.code)
            except DeviceTimeout:
                return  # the next turn begins with the others: it may be deaf to this one only
            except DeviceAbort as error:
                self._refuse(plan, one, str(error))
                continue
            self._take(plan, one, asked_ns, None if number is None else one.value(number))

    def _take(self, plan: int, one: _Source, asked_ns: int, value: float | None) -> None:
        """Take the answer, as old as the question: nobody knows how long it has waited."""
        with self._lock:
            if plan != self._plan:
                return
            if value is None:
                self._refused[one.channel] = "the device answers with no number of its type"
            else:
                self._refused.pop(one.channel, None)
            if (self._latest.stamp_ns(one.channel) or 0) < asked_ns:
                self._latest.update(asked_ns, (one.channel,), (value,))

    def _refuse(self, plan: int, one: _Source, words: str) -> None:
        with self._lock:
            if plan == self._plan:
                self._refused[one.channel] = words
