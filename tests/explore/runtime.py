"""Threads that are none: each is a greenlet, time is a number, and who runs next is decided here alone.

Time stands still while anybody can run, and jumps when nobody can. A *step* is a point at which something
may come in between: between two tasks, and within one wherever it touches what others see (`point`).
"""

import heapq
import itertools
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from greenlet import greenlet

Action = Callable[[], object]

START_NS = 1_000_000_000_000
MOST_STEPS_AT_ONCE = 100_000  # without time going on


class Spinning(BaseException):
    """Somebody does something again and again and never waits."""


class Task:
    """One thread of the code under test."""

    def __init__(self, name: str, owner: object) -> None:
        self.name = name
        self.owner = owner  # whose thread it is; it dies with its owner
        self.error: BaseException | None = None
        self.done = False
        self.place = 0  # where in its code it waits, as a number
        self.token = 0  # of what it waits for; 0: it does not wait
        self.woken = False
        self.greenlet: greenlet


class Runtime:
    """All tasks and the clock. What runs outside of any task runs in the hub, and must not wait."""

    def __init__(self) -> None:
        self.now_ns = START_NS
        self.steps = 0
        self.attention = 1 << 62  # the step at which `at_attention` is called next, in the hub
        self.at_attention: Action = lambda: None
        self.at_boundary: Action | None = None  # called in the hub between two tasks
        self.after_task: Action = lambda: None
        self.current: Task | None = None
        self.owner: object = None  # whom a task belongs to that the hub begins
        self.ready: deque[Task] = deque()
        self.tasks: list[Task] = []
        self.failed: list[Task] = []
        self._spinning_at = MOST_STEPS_AT_ONCE
        self._numbers = itertools.count(1)
        self._timers: list[tuple[int, int, Task | Action]] = []
        self._hub = greenlet.getcurrent()
        self._graveyard: list[Task] = []  # a greenlet that nobody knows is unwound, which a kill must not do

    # For tasks

    def spawn(self, name: str, work: Action) -> Task:
        """Begin a task, which belongs to whom its maker belongs to."""
        owner = self.owner if self.current is None else self.current.owner
        task = Task(name, owner)
        task.greenlet = greenlet(lambda: self._run_task(task, work), self._hub)
        self.tasks.append(task)
        self.ready.append(task)
        return task

    def point(self) -> None:
        """Here something may come in between."""
        self.steps += 1
        if self.steps > self._spinning_at:
            raise Spinning(
                f"{self.current and self.current.name} goes on and on at {self.now_ns / 1e9:.6f} s"
            )
        if self.steps >= self.attention and self.current is not None:
            self.ready.appendleft(self.current)
            self._to_hub()

    def end_of(self, timeout_ns: int | None) -> int | None:
        return None if timeout_ns is None else self.now_ns + timeout_ns

    def left_ns(self, until_ns: int | None) -> int | None:
        return None if until_ns is None else until_ns - self.now_ns

    def block(self, timeout_ns: int | None) -> bool:
        """Wait for `wake`, at most so long; whether it came."""
        task = self.current
        if task is None:
            raise RuntimeError("the hub waits for nobody")
        token = task.token = next(self._numbers)
        if timeout_ns is not None:
            heapq.heappush(self._timers, (self.now_ns + max(1, timeout_ns), token, task))
        self._to_hub()
        return task.woken

    def wake(self, task: Task) -> bool:
        """Let it run, if it waits; whether it does."""
        if not task.token:
            return False
        task.token = 0
        task.woken = True
        self.ready.append(task)
        return True

    # For the hub

    def call_at(self, due_ns: int, action: Action) -> None:
        """Run `action` in the hub at that time."""
        heapq.heappush(self._timers, (max(due_ns, self.now_ns), next(self._numbers), action))

    def call_in(self, delay_s: float, action: Action) -> None:
        """Run `action` in the hub so much later."""
        self.call_at(self.now_ns + round(delay_s * 1e9), action)

    def delay_next(self) -> None:
        """Let who would run next run last: what a busy processor does to a thread."""
        if len(self.ready) > 1:
            self.ready.rotate(-1)

    def kill(self, owner: object) -> None:
        """End all tasks of `owner` where they are; nothing of them runs any more."""
        dead = [task for task in self.tasks if task.owner is owner]
        self._graveyard += dead
        self.tasks = [task for task in self.tasks if task.owner is not owner]
        self.ready = deque(task for task in self.ready if task.owner is not owner)
        for task in dead:
            task.token = 0

    def run_until(self, due_ns: int, ended: Callable[[], bool] = lambda: False) -> bool:
        """Let everything happen until then, or until it has `ended`; whether it has."""
        while not ended():
            self.point()
            if self.steps >= self.attention:
                self.at_attention()
            if self.at_boundary is not None:
                self.at_boundary()
            if self.ready:
                self._switch_to(self.ready.popleft())
            elif self._timers and self._timers[0][0] <= due_ns:
                self._fire()
            else:
                self.now_ns = max(self.now_ns, due_ns)
                return ended()
        return True

    def run_for(self, seconds: float, ended: Callable[[], bool] = lambda: False) -> bool:
        """The same for so many seconds."""
        return self.run_until(self.now_ns + round(seconds * 1e9), ended)

    def waits(self) -> Iterable[tuple[Task, int | None]]:
        """Every task, and when it goes on by itself."""
        due = {number: due_ns for due_ns, number, what in self._timers if isinstance(what, Task)}
        return ((task, due.get(task.token)) for task in self.tasks)

    def _fire(self) -> None:
        due_ns, number, what = heapq.heappop(self._timers)
        if due_ns > self.now_ns:
            self.now_ns, self._spinning_at = due_ns, self.steps + MOST_STEPS_AT_ONCE
        if not isinstance(what, Task):
            what()
        elif what.token == number:
            what.token = 0
            what.woken = False
            self.ready.append(what)

    def _switch_to(self, task: Task) -> None:
        self.current = task
        task.greenlet.switch()
        self.current = None
        task.place = 0 if task.done else place_of(task.greenlet)
        self.after_task()

    def _to_hub(self) -> None:
        self._hub.switch()

    def _run_task(self, task: Task, work: Action) -> None:
        try:
            work()
        except BaseException as error:  # noqa: BLE001 - a thread that ends so is a finding
            task.error = error
            self.failed.append(task)
        task.done = True
        self.tasks.remove(task)


def place_of(run: Any) -> int:
    """Where a greenlet stands: the code and instruction of each of its frames, as one number."""
    frame, places = run.gr_frame, []
    while frame is not None:
        places.append((id(frame.f_code), frame.f_lasti))
        frame = frame.f_back
    return hash(tuple(places))
