"""The cost of monitoring on this robot, by client: rates since the same connection's last request."""

import resource
import threading
import time
from collections.abc import Iterable, Mapping
from typing import Any

from gateway.connections.session import Session
from gateway.streaming.outlets import Outlet
from gateway.streaming.rates import Rates
from gateway.streaming.streams import Streams
from gateway.wire.cost import BudgetInfo, BusCost, ClientCost, GatewayCost, StreamCost

FRAME_BITS = 47  # of an 11-bit data frame, with the gap behind it and without its data


class Costs:
    """One asker's view."""

    def __init__(self) -> None:
        self._rate = Rates()

    def look(
        self,
        rss_bytes: int,
        modules: Mapping[str, str],
        buses: Mapping[str, Any],
        sessions: Iterable[Session],
        streams: Streams,
        budget: BudgetInfo | None,
    ) -> GatewayCost:
        """Everything now; `buses` are those of the drivers, by name."""
        now_ns, usage = time.monotonic_ns(), resource.getrusage(resource.RUSAGE_SELF)
        self._rate.look(now_ns)
        return GatewayCost(
            stamp_ns=now_ns,
            cpu_percent=self._rate.percent("cpu", time.process_time_ns()),
            rss_bytes=rss_bytes,
            threads=threading.active_count(),
            wake_ups_per_s=self._rate.rounded("wake-ups", usage.ru_nvcsw + usage.ru_nivcsw),
            modules=dict(modules),
            buses={name: self._bus(name, bus) for name, bus in buses.items()},
            clients=[self._client(session, streams.of(session)) for session in sessions],
            budget=budget,
        )

    def _client(self, session: Session, outlets: list[Outlet]) -> ClientCost:
        return ClientCost(
            who=session.who,
            cpu_percent=self._rate.percent((session, "cpu"), session.cpu_ns),
            requests_per_s=self._rate.rounded((session, "requests"), session.requests),
            sent_bytes_per_s=self._rate.rounded((session, "sent"), session.sent_bytes),
            received_bytes_per_s=self._rate.rounded((session, "received"), session.received_bytes),
            waiting_bytes=session.waiting_bytes + sum(outlet.waiting_bytes for outlet in outlets),
            streams=[self._stream(outlet) for outlet in outlets],
        )

    def _stream(self, outlet: Outlet) -> StreamCost:
        return StreamCost(
            stream=outlet.number,
            rate_hz=outlet.feed.rate_hz,
            channels=outlet.feed.channels,
            rows_per_s=self._rate.rounded((outlet, "rows"), outlet.rows),
            dropped=outlet.dropped,
            shed=outlet.feed.shed,
        )

    def _bus(self, name: str, bus: Any) -> BusCost:
        bitrate = bus.settings.bitrate
        bits = self._rate((name, "bits"), FRAME_BITS * bus.sent + 8 * bus.sent_bytes)
        return BusCost(
            sent_frames_per_s=self._rate.rounded((name, "sent"), bus.sent),
            sent_bytes_per_s=self._rate.rounded((name, "bytes"), bus.sent_bytes),
            received_frames_per_s=self._rate.rounded((name, "received"), bus.frames),
            load_percent=None if bits is None or not bitrate else round(2 * 100 * bits / bitrate, 3),
        )
