"""The one simulated clock: events in order of time, then in order of their making.

Nothing in the simulator reads another clock. Whoever runs the clock decides how simulated time relates to
real time, and the same events in the same order give the same robot.
"""

import heapq
from collections.abc import Callable

MILLISECOND_NS = 1_000_000
SECOND_NS = 1_000_000_000

Action = Callable[[], None]


class Event:
    """Something that will happen at `due_ns`, unless it is cancelled."""

    __slots__ = ("action", "due_ns")

    def __init__(self, due_ns: int, action: Action) -> None:
        self.due_ns = due_ns
        self.action: Action | None = action

    def cancel(self) -> None:
        self.action = None


class Clock:
    """Simulated time in nanoseconds since the robot was switched on, and what is still to happen."""

    def __init__(self) -> None:
        self.now_ns = 0
        self._events: list[tuple[int, int, Event]] = []  # when, in which order made, what
        self._made = 0

    @property
    def now_s(self) -> float:
        return self.now_ns / SECOND_NS

    def at(self, due_ns: int, action: Action) -> Event:
        """Call `action` at `due_ns`; a time that has passed means now."""
        self._made += 1
        event = Event(max(due_ns, self.now_ns), action)
        heapq.heappush(self._events, (event.due_ns, self._made, event))
        return event

    def after(self, delay_ns: int, action: Action) -> Event:
        return self.at(self.now_ns + delay_ns, action)

    def every(self, period_ns: int, action: Action) -> "Repeating":
        """Call `action` each `period_ns`, for the first time one period from now."""
        return Repeating(self, period_ns, action)

    def next_due_ns(self) -> int | None:
        """Return when the next event is due, `None` if nothing is to happen."""
        while self._events and self._events[0][2].action is None:
            heapq.heappop(self._events)
        return self._events[0][0] if self._events else None

    def run_until(self, end_ns: int) -> None:
        """Let everything happen that is due up to `end_ns`, and arrive there."""
        events = self._events
        while events and events[0][0] <= end_ns:
            due_ns, _, event = heapq.heappop(events)
            if event.action is not None:
                self.now_ns = due_ns
                event.action()
        self.now_ns = max(self.now_ns, end_ns)


class Repeating:
    """An action that comes back each period, without drift."""

    def __init__(self, clock: Clock, period_ns: int, action: Action) -> None:
        self._clock = clock
        self._period_ns = period_ns
        self._action = action
        self._event = clock.after(period_ns, self._tick)

    def _tick(self) -> None:
        self._event = self._clock.at(self._event.due_ns + self._period_ns, self._tick)
        self._action()

    def cancel(self) -> None:
        self._event.cancel()
