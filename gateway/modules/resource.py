"""The resource module: the computer's own CPU, memory and processes, measured only when somebody asks.

Percentages are over the time since the same connection asked last; what cannot be known yet is `None`.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from drivers.latest import Latest, Listener
from drivers.samples import Channel
from gateway.messages import ResourceSnapshot, ResourceSnapshotParams
from gateway.sources import Selection, whole
from gateway.wire import Kind, refuse

if TYPE_CHECKING:
    from gateway.loop import Timer
    from gateway.modules.host import Host, Meter
    from gateway.registry import Context
    from gateway.session import Answer, Session

NAME = "resource"
SAMPLE_PERIOD_S = 1.0  # of the streamed columns

_UNITS = {
    "cpu_percent": "%",
    "memory_percent": "%",
    "memory_used": "B",
    "swap_used": "B",
    "load_1min": "",
    "gateway_cpu_percent": "%",
    "gateway_rss": "B",
}
RESOURCE_CHANNELS = tuple(Channel(f"{NAME}.{name}", NAME, name, unit) for name, unit in _UNITS.items())
_ALL = tuple(range(len(RESOURCE_CHANNELS)))


def columns(snapshot: ResourceSnapshot) -> tuple[float | None, ...]:
    """A snapshot as the values of `RESOURCE_CHANNELS`."""
    memory = snapshot.memory
    return (
        snapshot.cpu.percent,
        100.0 * memory.used / memory.total if memory.total else None,
        memory.used,
        memory.swap_used,
        snapshot.cpu.load[0] if snapshot.cpu.load else None,
        snapshot.gateway.cpu_percent,
        snapshot.gateway.rss_bytes,
    )


class HostSource:
    """The streamed columns; it measures once a period, and only while somebody listens."""

    name = NAME
    channels = RESOURCE_CHANNELS

    def __init__(self, context: "Context", host: "Host") -> None:
        self.latest = Latest(NAME, RESOURCE_CHANNELS, stale_after_s=3 * SAMPLE_PERIOD_S)
        self._loop = context.loop
        self._host = host
        self._meter: Meter | None = None
        self._listening = 0
        self._timer: Timer | None = None

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        end = self.latest.subscribe(listener)
        self._listening += 1
        if self._timer is None:
            self._meter = self._host.meter()
            self._timer = self._loop.call_later(0.0, self._measure)

        def unsubscribe() -> None:
            end()
            self._listening -= 1
            if not self._listening:
                self.close()

        return unsubscribe

    def close(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self.latest.clear()

    def _measure(self) -> None:
        if self._meter is None:
            return
        snapshot = self._meter.snapshot(ResourceSnapshotParams(processes=False))
        self.latest.update(snapshot.stamp_ns, _ALL, columns(snapshot))
        self._timer = self._loop.call_later(SAMPLE_PERIOD_S, self._measure)


class ResourceModule:
    """Snapshots of the host, and its columns for streams."""

    absent: Mapping[str, str] = {}

    def __init__(self, context: "Context") -> None:
        self._context = context
        loop = context.config.control_loop
        self._control = () if loop is None else loop.processes
        self._meters: dict[tuple[Session, str], Meter] = {}
        self.handlers: Mapping[str, Callable[[Session, Any], Answer]] = {"resource.snapshot": self._snapshot}

    def start(self) -> None:
        from gateway.modules.host import Host  # how it measures is loaded with the first question

        self._host = Host(self._control)
        self._source = HostSource(self._context, self._host)

    def stop(self) -> None:
        self._source.close()
        self._host.close()

    def meter(self) -> "Meter":
        """For another asker, whose percentages are since its own last look."""
        return self._host.meter()

    def own_rss_bytes(self) -> int:
        """What the gateway holds."""
        return self._host.own_rss_bytes()

    def selections(self) -> list[Selection]:
        return [whole(self._source)]

    def measure(self, session: "Session", method: str, params: ResourceSnapshotParams) -> ResourceSnapshot:
        """A snapshot whose percentages are since this connection last called `method`."""
        meter = self._meters.get((session, method))
        if meter is None:
            meter = self._meters[session, method] = self.meter()
            session.on_close(lambda: self._forget(session, method))
        return meter.snapshot(params)

    def _forget(self, session: "Session", method: str) -> None:
        self._meters.pop((session, method), None)

    def _snapshot(self, session: "Session", params: ResourceSnapshotParams) -> ResourceSnapshot:
        if "control" in params.include and not self._control:
            raise refuse(Kind.BAD_PARAMS, "control: the robot's file names no processes in [control_loop]")
        return self.measure(session, "resource.snapshot", params)
