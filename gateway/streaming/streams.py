"""Streams: who has asked for which channels, and what all of them may cost together.

Where the gateway has a budget, it is the rate of all feeds that gives way.
"""

import itertools
from collections.abc import Callable, Iterable

from gateway.connections.session import Session
from gateway.process.loop import Loop
from gateway.streaming.budget import Budget
from gateway.streaming.feeds import Feed, SampleFeed, TickFeed, values_a_second
from gateway.streaming.outlets import Outlet
from gateway.streaming.sources import Selection
from gateway.wire import framing
from gateway.wire.limits import (
    ALL_VALUES_A_SECOND,
    ROW_VALUES,
    SMALL_VALUES_A_SECOND,
    STREAMS,
    VALUES_A_SECOND,
)


class Streams:
    """All streams of the gateway; `buffer_bytes` is what may wait for one client's."""

    def __init__(self, loop: Loop, buffer_bytes: int, budget: Budget) -> None:
        self._loop = loop
        self._buffer_bytes = buffer_bytes
        self._budget = budget
        budget.shed, budget.late_s = self._shed, self._late_s
        self._numbers = itertools.count(1)
        self._feeds: dict[tuple[float, tuple[str, ...]], Feed] = {}

    def start(self, session: Session, selections: Iterable[Selection], rate_hz: float) -> int:
        """Subscribe a session; its connection's end ends the stream. Returns the stream's number.

        Raises:
            RpcError: unavailable: it has as many streams as it may, or they cost too much.

        """
        if len(session.outlets) >= STREAMS:
            most = f"a client may have {STREAMS} streams; end one, or ask for more channels in one"
            raise framing.refuse(framing.ErrorKind.UNAVAILABLE, most)
        chosen = list(selections)
        key = (rate_hz, tuple(name for selection in chosen for name in selection.names))
        feed = self._feeds.get(key)
        self._check_cost(session, values_a_second(rate_hz, len(key[1])), is_new=feed is None)
        if feed is None:
            feed = TickFeed(self._loop, chosen, rate_hz) if rate_hz else SampleFeed(self._loop, chosen)
            self._feeds[key] = feed
            feed.shed_to(self._budget.factor)
            self._budget.watch(on=True)
        outlet = Outlet(next(self._numbers), session, feed, self._buffer_bytes)
        feed.outlets.append(outlet)
        if not session.outlets:
            session.on_close(lambda: self._forget(session), self)
        session.outlets[outlet.number] = outlet
        self._share(session)
        return outlet.number

    def _check_cost(self, session: Session, wanted: float, *, is_new: bool) -> None:
        """Refuse what one client, or all together, would make the robot work too much for."""
        own = wanted + sum(outlet.feed.values_a_second for outlet in self.of(session))
        together = wanted * is_new + sum(feed.values_a_second for feed in self._feeds.values())
        if own <= SMALL_VALUES_A_SECOND or (own <= VALUES_A_SECOND and together <= ALL_VALUES_A_SECOND):
            return
        whose, cost, most = (
            ("your streams", own, VALUES_A_SECOND)
            if own > VALUES_A_SECOND
            else ("the streams of all clients", together, ALL_VALUES_A_SECOND)
        )
        raise framing.refuse(
            framing.ErrorKind.UNAVAILABLE,
            f"{whose} would cost {cost:,.0f} values a second, and {most:,} is the most (a row counts as its "
            f"channels and {ROW_VALUES} more): ask for a lower rate, or fewer channels",
            limit=float(most),
        )

    def stop(self, session: Session, number: int) -> bool:
        """End one stream of a session; false where it has no such stream."""
        if number not in session.outlets:
            return False
        del session.outlets[number]
        self._remove(lambda outlet: outlet.number == number)
        self._share(session)
        return True

    def of(self, session: Session) -> list[Outlet]:
        """Return a client's streams."""
        return [one for feed in self._feeds.values() for one in feed.outlets if one.session is session]

    def _share(self, session: Session) -> None:
        """All streams of a client have its buffer together."""
        outlets = self.of(session)
        for outlet in outlets:
            outlet.most_bytes = self._buffer_bytes // len(outlets)

    def _late_s(self) -> float:
        """Return the delay of the latest feed since the last call."""
        return max((feed.was_late_s() for feed in self._feeds.values()), default=0.0)

    def _shed(self, factor: int) -> None:
        for feed in self._feeds.values():
            feed.shed_to(factor)

    def _forget(self, session: Session) -> None:
        self._remove(lambda outlet: outlet.session is session)

    def _remove(self, leaving: Callable[[Outlet], bool]) -> None:
        for key, feed in tuple(self._feeds.items()):
            feed.outlets = [outlet for outlet in feed.outlets if not leaving(outlet)]
            if not feed.outlets:
                del self._feeds[key]
                feed.close()
        if not self._feeds:
            self._budget.watch(on=False)
