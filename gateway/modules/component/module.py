"""The component module: the robot's buses, drives, insoles and IMUs, from first use to last.

A snapshot of components that have only just been started waits for their first values, at most `COLD_S`.
"""

import time
from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING

from msgspec import UNSET, UnsetType

from drivers.component import Component
from drivers.latest import Latest, Listener
from drivers.samples import Channel, ComponentState
from gateway.handlers import Handlers, on
from gateway.modules.component.assembly import BUILDERS, Robot, assemble, facts
from gateway.modules.component.findings import bus_infos, emcy_info, finding_infos
from gateway.process.futures import done, then
from gateway.streaming.sources import Selection, Source, channel_info, check_globs, narrow, whole
from gateway.wire.bus import BUS_SNAPSHOT, Buses, BusInfo
from gateway.wire.component import (
    COMPONENT_SNAPSHOT,
    AngleInfo,
    ChannelInfo,
    ComponentInfo,
    LayoutInfo,
    QualityInfo,
    Snapshot,
    SnapshotParams,
)
from gateway.wire.method import Params

if TYPE_CHECKING:
    from gateway.connections.session import Session
    from gateway.registry import Context

COLD_S = 1.0
LATE_S = 5.0  # a device that answers, but is not read to the end yet, is waited for as long
LOOK_S = 0.02  # how often a cold start looks whether the first values are there


@dataclass(frozen=True, slots=True)
class ComponentSource:
    """A component as a source of samples."""

    component: Component

    @property
    def name(self) -> str:
        return self.component.name

    @property
    def channels(self) -> tuple[Channel, ...]:
        return self.component.channels

    @property
    def latest(self) -> Latest:
        return self.component.latest

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        return self.component.latest.subscribe(listener)


class ComponentModule:
    """Everything that moves or measures on the robot."""

    def __init__(self, context: "Context") -> None:
        self.robot = Robot()
        self.sources: list[Source] = []  # what is no component and has channels all the same
        self._context = context
        self._warm_ns = 0
        self._late_ns = 0
        self._waiting: list[tuple[Callable[[], bool], Future[None]]] = []
        self.handlers = Handlers(on(COMPONENT_SNAPSHOT, self._snapshot), on(BUS_SNAPSHOT, self._buses))

    def start(self) -> None:
        """Build and start everything; a component that cannot start is left out, and it is said why."""
        self.robot = assemble(self._context.config)
        for bus in self.robot.buses.values():
            bus.start()
        for name, component in tuple(self.robot.components.items()):
            try:
                component.start()
            except Exception as error:  # noqa: BLE001 - one device's fault must not take the others with it
                del self.robot.components[name]
                self.robot.absent[name] = (component.kind, f"cannot start, {type(error).__name__}: {error}")
        now_ns = time.monotonic_ns()
        self._warm_ns = now_ns + round(COLD_S * 1e9)
        self._late_ns = now_ns + round(LATE_S * 1e9)

    def stop(self) -> None:
        """Stop everything, the buses last; every device is tried, and what failed is raised together."""
        failures: list[Exception] = []
        components, buses = self.robot.components.values(), self.robot.buses.values()
        for stop in [*(one.stop for one in components), *(bus.stop for bus in buses)]:
            try:
                stop()
            except Exception as error:  # noqa: BLE001 - raised below, after every device had its turn
                failures.append(error)
        if failures:
            raise ExceptionGroup("some devices did not stop", failures)

    @property
    def absent(self) -> Mapping[str, str]:
        return {name: why for name, (_kind, why) in self.robot.absent.items()}

    def selections(self) -> list[Selection]:
        components = [ComponentSource(one) for one in self.robot.components.values() if one.channels]
        return [whole(one) for one in (*components, *self.sources)]

    def when_ready(self, names: Iterable[str]) -> "Future[None]":
        """Return a future, done when these components are there, or the time for a cold start is over.

        A device whose first reading is still under way then (a busy computer, a slow bus) has longer.
        """
        wanted = tuple(names)

        def over() -> bool:
            missing = [name for name in wanted if not self._is_there(name)]
            return not missing or (self._is_warm() and not any(map(self._is_late, missing)))

        return self._when(over)

    def when_known(self, selections: Iterable[Selection]) -> "Future[None]":
        """Return a future, done when these channels had first values, or a cold start's time is over."""
        wanted = tuple(selections)
        return self._when(lambda: self._is_warm() or all(map(_has_values, wanted)))

    def read(self, selections: Iterable[Selection], also: Collection[str] = ()) -> Snapshot:
        """Return the present values, and the quality of their components and of the named ones."""
        now_ns = time.monotonic_ns()
        values: dict[str, float | None] = {}
        stamps_ns: dict[str, int | None] = {}
        asked = set(also)
        for one in selections:
            latest, channels = one.source.latest, one.source.channels
            for index in one.indices:
                name = channels[index].name
                values[name], stamps_ns[name] = latest.read(index, now_ns)
            asked.add(one.source.name)
        quality = {name: self.quality(name, now_ns) for name in self._names() if name in asked}
        # Not `now_ns`: what has come while this was read would be younger than nothing.
        return Snapshot(time.monotonic_ns(), values, stamps_ns, quality)

    def quality(self, name: str, now_ns: int) -> QualityInfo:
        """One component's state, age and counters, and in words what is wrong."""
        if name in self.robot.absent:
            return {"state": ComponentState.LOST.value, "age_ms": None, "problem": self.robot.absent[name][1]}
        quality = self.robot.components[name].quality(now_ns)
        return {
            **quality.counters,
            "state": quality.state.value,
            "age_ms": quality.age_ms,
            "problem": quality.problem,
        }

    def components(self) -> list[ComponentInfo]:
        """Return every component of the file, there or not, in the file's order."""
        now_ns = time.monotonic_ns()
        return [self._info(name, now_ns) for name in self._names()]

    def _names(self) -> list[str]:
        """Return the names of all components of the file, there or not, in the file's order."""
        return self._context.config.names(*BUILDERS)

    def _info(self, name: str, now_ns: int) -> ComponentInfo:
        component = self.robot.components.get(name)
        if component is None:
            return self._absent_info(name)
        quality = component.quality(now_ns)
        return ComponentInfo(
            name,
            component.kind.value,
            quality.state.value,
            quality.problem,
            self._device(name),
            _layout(component),
            finding_infos(quality.findings) or UNSET,
            emcy_info(component),
            self._angle(name),
            getattr(component, "calibration", UNSET),
        )

    def _absent_info(self, name: str) -> ComponentInfo:
        kind, why = self.robot.absent[name]
        device, angle = self._device(name), self._angle(name)
        return ComponentInfo(name, kind.value, ComponentState.LOST.value, why, device, angle=angle)

    def _angle(self, name: str) -> AngleInfo | UnsetType:
        """Return it as the robot's file says it, whether the drive is there or not."""
        settings = self._context.config.joint.get(name)
        return UNSET if settings is None else AngleInfo(settings.rad_per_count, settings.zero_offset)

    def _device(self, name: str) -> dict[str, str | int] | UnsetType:
        description = self.robot.descriptions.get(name)
        return UNSET if description is None else dict(facts(self._context.config, name, description))

    def buses(self) -> list[BusInfo]:
        """Return every CAN bus of the file."""
        return bus_infos(self.robot.buses, time.monotonic_ns())

    def channels(self) -> list[ChannelInfo]:
        channels = [one.channels for one in self.robot.components.values()]
        channels += [one.channels for one in self.sources]
        return [channel_info(channel) for some in channels for channel in some]

    def _snapshot(self, _session: "Session", params: SnapshotParams) -> "Future[Snapshot]":
        selections = self.selections()
        names = [name for one in selections for name in one.names]
        check_globs("channel", names, params.channels, self.absent)
        chosen = narrow(selections, params.channels)
        ready = self.when_known(chosen)
        return then(ready, lambda _none: self._answer(chosen, everything=params.channels is None))

    def _buses(self, _session: "Session", _params: Params) -> "Future[Buses]":
        return done(Buses(time.monotonic_ns(), self.buses()))

    def _answer(self, chosen: list[Selection], *, everything: bool) -> Snapshot:
        # Everything: also those without channels, and those that are not there.
        return self.read(chosen, self._names() if everything else ())

    def _is_there(self, name: str) -> bool:
        component = self.robot.components.get(name)
        return component is None or component.quality(time.monotonic_ns()).state is not ComponentState.LOST

    def _is_late(self, name: str) -> bool:
        """Return whether it is being read for the first time, and is worth waiting for."""
        node = getattr(self.robot.components.get(name), "node", None)
        return node is not None and node.comes_up and time.monotonic_ns() < self._late_ns

    def _when(self, over: Callable[[], bool]) -> "Future[None]":
        if over():
            return done(None)
        future: Future[None] = Future()
        self._waiting.append((over, future))
        if len(self._waiting) == 1:
            self._context.loop.call_later(LOOK_S, self._look)
        return future

    def _is_warm(self) -> bool:
        return time.monotonic_ns() >= self._warm_ns

    def _look(self) -> None:
        ended = [future for over, future in self._waiting if over()]
        self._waiting = [(over, future) for over, future in self._waiting if future not in ended]
        if self._waiting:
            self._context.loop.call_later(LOOK_S, self._look)
        for future in ended:  # last, because whoever waited may begin to wait for something else
            future.set_result(None)


def _has_values(selection: Selection) -> bool:
    latest, now_ns = selection.source.latest, time.monotonic_ns()
    return all(latest.read(index, now_ns)[1] is not None for index in selection.indices)


def _layout(component: Component) -> LayoutInfo | UnsetType:
    """Return the places of a component's cells, if it has some."""
    layout = getattr(component, "layout", None)
    return UNSET if layout is None else LayoutInfo(layout.name, list(layout.cells))
