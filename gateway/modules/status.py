"""The status module: the merged, minimal set that status prediction needs, from resource and component."""

from collections.abc import Mapping
from concurrent.futures import Future
from typing import TYPE_CHECKING, cast

from gateway.handlers import Handlers, on
from gateway.modules.resource.module import RESOURCE_CHANNELS, ResourceModule, columns
from gateway.process.futures import then
from gateway.streaming.sources import Selection, narrow
from gateway.wire.component import STATUS_SNAPSHOT, Snapshot
from gateway.wire.method import Params
from gateway.wire.resource import ResourceSnapshot

if TYPE_CHECKING:
    from gateway.connections.session import Session
    from gateway.modules.component.module import ComponentModule
    from gateway.registry import Context

# What the prediction's features are made from; everything else stays on the robot.
COMPONENT_GLOBS = (
    "*.position",
    "*.velocity",
    "*.force",
    "*.cop_x",
    "*.cop_y",
    "*.tilt_forward",
    "*.tilt_side",
    "*.angular_velocity_?",
)
RESOURCE_GLOBS = ("resource.cpu_percent", "resource.memory_percent")


class StatusModule:
    """A choice of the other two modules' channels."""

    def __init__(self, context: "Context") -> None:
        self._component = cast("ComponentModule", context.needs["component"])
        self._resource = cast("ResourceModule", context.needs["resource"])
        self.handlers = Handlers(on(STATUS_SNAPSHOT, self._snapshot))

    def start(self) -> None:
        """Nothing of its own runs."""

    def stop(self) -> None:
        """Nothing of its own runs."""

    @property
    def absent(self) -> Mapping[str, str]:
        return self._component.absent

    def selections(self) -> list[Selection]:
        return [*self._components(), *narrow(self._resource.selections(), RESOURCE_GLOBS)]

    def _components(self) -> list[Selection]:
        return narrow(self._component.selections(), COMPONENT_GLOBS)

    def _snapshot(self, session: "Session", _params: Params) -> "Future[Snapshot]":
        chosen = self._components()
        ready = self._component.when_known(chosen)
        measured = then(ready, lambda _none: self._resource.measure(session, STATUS_SNAPSHOT.name))
        return then(measured, lambda host: self._answer(chosen, host))

    def _answer(self, chosen: list[Selection], host: ResourceSnapshot) -> Snapshot:
        snapshot = self._component.read(chosen, self._component.absent)
        for channel, value in zip(RESOURCE_CHANNELS, columns(host), strict=True):
            if channel.name in RESOURCE_GLOBS:
                snapshot.values[channel.name] = value
                snapshot.stamps_ns[channel.name] = host.stamp_ns
        return snapshot
