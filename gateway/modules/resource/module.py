"""The resource module: the computer's own CPU, memory and processes, measured only when somebody asks.

Percentages are over the time since the same connection asked last; what cannot be known yet is `None`. Looks
are taken in a thread of their own, one after the other: a table with command lines takes many milliseconds.
"""

import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import msgspec

from drivers.latest import Latest, Listener
from drivers.samples import Channel
from gateway.connections.fair_queue import FairQueue
from gateway.handlers import Handlers, on
from gateway.process.futures import back, done, pass_on, then
from gateway.streaming.sources import Selection, whole
from gateway.wire.framing import ErrorKind, refuse
from gateway.wire.resource import RESOURCE_SNAPSHOT, ResourceSnapshot, ResourceSnapshotParams

if TYPE_CHECKING:
    from gateway.connections.session import Session
    from gateway.modules.resource.host import Host, Meter
    from gateway.process.loop import Timer
    from gateway.registry import Context

T = TypeVar("T")
Look = Callable[["Meter", ResourceSnapshotParams], "Future[ResourceSnapshot]"]

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
_NO_PROCESSES = ResourceSnapshotParams(processes=False)
_encoder = msgspec.json.Encoder()


def columns(snapshot: ResourceSnapshot) -> tuple[float | None, ...]:
    """Return a snapshot as the values of `RESOURCE_CHANNELS`."""
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


@dataclass(frozen=True, slots=True, eq=False)
class _Wish:
    """Something to measure for a client, and its answer."""

    begin: "Callable[[], Future[Any]]"
    answer: "Future[Any]"


class HostSource:
    """The streamed columns; it measures once a period, and only while somebody listens."""

    name = NAME
    channels = RESOURCE_CHANNELS

    def __init__(self, context: "Context", host: "Host", look: Look) -> None:
        self.latest = Latest(NAME, RESOURCE_CHANNELS, stale_after_s=3 * SAMPLE_PERIOD_S)
        self._loop = context.loop
        self._host = host
        self._look = look
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
            self._timer = self._meter = None
        self.latest.clear()

    def _measure(self) -> None:
        meter = self._meter
        if meter is not None:
            self._timer = self._loop.call_later(SAMPLE_PERIOD_S, self._measure)
            then(self._look(meter, _NO_PROCESSES), lambda snapshot: self._measured(meter, snapshot))

    def _measured(self, meter: "Meter", snapshot: ResourceSnapshot) -> None:
        if meter is self._meter:  # somebody still listens
            self.latest.update(snapshot.stamp_ns, _ALL, columns(snapshot))


class ResourceModule:
    """Snapshots of the host, and its columns for streams."""

    absent: Mapping[str, str] = {}

    def __init__(self, context: "Context") -> None:
        self._context = context
        loop = context.config.control_loop
        self._control = () if loop is None else loop.processes
        self._meters: dict[tuple[Session, str], Meter] = {}
        self._turns = FairQueue[_Wish]()
        self._measuring = False  # for a client
        self.handlers = Handlers(on(RESOURCE_SNAPSHOT, self._snapshot))

    def start(self) -> None:
        from gateway.modules.resource.host import Host  # how it measures is loaded with the first question

        self._host = Host(self._control)
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix=NAME)
        self._source = HostSource(self._context, self._host, self.look)

    def stop(self) -> None:
        self._source.close()
        self._worker.shutdown(wait=True)
        self._host.close()

    def meter(self) -> "Meter":
        """Return a meter for another asker, whose percentages are since its own last look."""
        return self._host.meter()

    def own_rss_bytes(self) -> int:
        """Return the gateway's resident memory."""
        return self._host.own_rss_bytes()

    def selections(self) -> list[Selection]:
        return [whole(self._source)]

    def look(self, meter: "Meter", params: ResourceSnapshotParams) -> "Future[ResourceSnapshot]":
        """Return a snapshot of one asker's, given in the loop."""
        return back(self._context.loop, self._worker.submit(meter.snapshot, params))

    def measure(self, session: "Session", method: str) -> "Future[ResourceSnapshot]":
        """Return a snapshot; its percentages are since this connection last called `method`."""
        meter = self._meter_of(session, method)
        return self._for(session, lambda: meter.snapshot(_NO_PROCESSES))

    def _meter_of(self, session: "Session", method: str) -> "Meter":
        meter = self._meters.get((session, method))
        if meter is None:
            meter = self.meter()
            if not session.closed:
                self._meters[session, method] = meter
                session.on_close(lambda: self._forget(session, method))
        return meter

    def _forget(self, session: "Session", method: str) -> None:
        self._meters.pop((session, method), None)

    def _snapshot(self, session: "Session", params: ResourceSnapshotParams) -> "Future[msgspec.Raw]":
        """As it goes on the wire."""
        if "control" in params.include and not self._control:
            raise refuse(
                ErrorKind.BAD_PARAMS, "control: the robot's file names no processes in [control_loop]"
            )
        meter = self._meter_of(session, RESOURCE_SNAPSHOT.name)
        return self._for(session, lambda: msgspec.Raw(_encoder.encode(meter.snapshot(params))))

    def _for(self, session: "Session", work: Callable[[], T]) -> "Future[T]":
        """Let the worker do it in turn, on the session's account."""
        answer: Future[T] = Future()

        def metered() -> tuple[T, int]:
            began_ns = time.thread_time_ns()
            return work(), time.thread_time_ns() - began_ns

        def give(done: tuple[T, int]) -> T:
            session.cpu_ns += done[1]
            return done[0]

        wish = _Wish(lambda: then(back(self._context.loop, self._worker.submit(metered)), give), answer)
        self._turns.add(session, wish)
        self._go_on()
        return answer

    def _go_on(self) -> None:
        """One thing at a time, so that what waits is in turn."""
        following = None if self._measuring else self._turns.next(lambda wish: wish)
        if following is not None:
            client, wish, _wish = following
            self._turns.done(client, wish)
            self._measuring = True
            given = then(done(None), lambda _none: wish.begin())  # also where it raises
            given.add_done_callback(lambda given: pass_on(given, wish.answer))
            given.add_done_callback(lambda _given: self._context.loop.post(self._ended))

    def _ended(self) -> None:
        self._measuring = False
        self._go_on()
