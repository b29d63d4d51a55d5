"""Tries orders of events: each run is a process that forks wherever something else could happen as well.

So every branch has a true copy of the whole state, and nothing is ever played twice to get there. The tree of
orders is walked in passes, each over a larger share of its branches, until all of it was walked.
"""

import gc
import itertools
import os
import random
import signal
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from tests.explore.can import Sent
from tests.explore.events import Event
from tests.explore.invariants import Judged
from tests.explore.player import Order, Player
from tests.explore.report import Found, note
from tests.explore.runtime import START_NS, Spinning
from tests.explore.scenes import Scene
from tests.explore.shared import Count, Shared
from tests.explore.stage import Finding, Violation

WINDOW_NS = 2_000_000_000  # how long after an event the next one may still come in between
SHARES = (0.0, 0.001, 0.005, 0.02, 0.1, 0.4, 1.0)
TREE_SHARE = 0.6  # of the time; the rest is for random orders
MOST_EVENTS = 25
HANGS_S = 60
_FINE = 1_000_003


@dataclass(frozen=True, slots=True)
class Options:
    """What is asked of a search."""

    seconds: float
    seed: int
    depth: int
    workers: int
    events: tuple[Event, ...]  # what may happen
    judged: Judged
    first: bool  # whether the first violation ends it
    begun: float  # time.time()
    reports: Path  # where violations are noted

    @property
    def ended(self) -> bool:
        """Whether what was looked for was found."""
        return self.first and self.reports.exists()


class Search:
    """One worker's part of the search that begins in one scene."""

    def __init__(self, scene: Scene, options: Options, shared: Shared, until: float) -> None:
        self.scene, self.options, self.shared = scene, options, shared
        gc.disable()
        self.stage = scene.build(options.judged)
        gc.freeze()
        self.player = Player(self.stage)
        self._until = until
        self._left = 0  # events that may still happen in this run
        self._low, self._high = 0.0, 0.0  # the share that this pass walks
        self._walked = True  # whether an earlier pass has been on this branch
        self._window_ns = 0
        self._number = 0  # of branches of this run

    def run(self) -> None:
        """Until the time is over; the tree alone, where there is no limit."""
        begun = time.monotonic()
        tree_until = begun + TREE_SHARE * (self._until - begun)
        for low, high in itertools.pairwise(SHARES):
            if time.monotonic() < tree_until:
                self._fork(lambda low=low, high=high: self._tree(low, high, tree_until), ())  # type: ignore[misc]
        seed = 0
        while self.options.seconds and not self._is_over():
            seed += 1
            self._fork(lambda seed=seed: self._random(seed), ((seed, "random"),))  # type: ignore[misc]

    def _tree(self, low: float, high: float, until: float) -> None:
        runtime = self.stage.runtime
        self._low, self._high, self._until = low, high, until
        self._left = self.options.depth
        self._window_ns = runtime.now_ns + (0 if self.scene.settles else WINDOW_NS)
        runtime.at_boundary = self._at_boundary
        self.stage.run_for(0.0)
        self.stage.settle()
        self._left = 0
        self._end()

    def _random(self, seed: int) -> None:
        source = random.Random(f"{self.options.seed} {seed} {self.shared.worker} {self.scene.name}")
        self.player.improvise(source, source.randint(3, MOST_EVENTS), self.options.events)

    def _is_over(self) -> bool:
        return time.monotonic() > self._until or self.options.ended

    def _end(self) -> None:
        """Where another run has been, its end is known too."""
        if self.shared.is_new(hash((self.scene.name, "end", self.stage.fingerprint()))):
            self.stage.end()
        else:
            self.shared.add(Count.CUT)

    # The tree

    def _at_boundary(self) -> None:
        """In the hub between two tasks: whatever can happen here happens, each in a process of its own."""
        if not self._left:
            return
        if self.stage.runtime.now_ns > self._window_ns and self._number:
            return
        state = hash((self.scene.name, self.stage.fingerprint()))
        if self.shared.is_new(state):
            self.shared.add(Count.STATES)
        for event in self.options.events:
            if self._is_over():
                self._left = 0
                return
            if event.possible(self.stage) and self._is_due(event, state) and self._branch(event):
                return

    def _is_due(self, event: Event, state: int) -> bool:
        """Whether this branch belongs to this pass and to this worker, and leads where nobody has been."""
        self._number += 1
        level = self.options.depth - self._left + (not self.scene.settles)
        order = (self.options.seed, self.player.order, self._number, event.name)
        place = hash(order) % _FINE / _FINE
        if place >= self._high**level:
            return False
        if not self.player.order and self._number % self.options.workers != self.shared.worker:
            return False
        last = self._left == 1
        if last and self._walked and place < self._low**level:
            return False
        if self.player.order and not self.shared.is_new(hash((state, event.name, last or self._high))):
            self.shared.add(Count.CUT)
            return False
        return True

    def _branch(self, event: Event) -> bool:
        """Let it happen in a process of its own; true there."""
        level = self.options.depth - self._left + (not self.scene.settles)
        order = (*self.player.order, (self.stage.runtime.steps, event.name))
        child = os.fork()
        if child:
            self._wait(child, order)
            return False
        place = hash((self.options.seed, self.player.order, self._number, event.name)) % _FINE / _FINE
        self._walked = self._walked and place < self._low**level
        self._left -= 1
        self._number = 0
        if not self._left:
            signal.alarm(HANGS_S)
        self.player.do(event)
        self._window_ns = self.stage.runtime.now_ns + WINDOW_NS
        return True

    # Processes

    def _fork(self, work: Callable[[], None], about: Order) -> None:
        child = os.fork()
        if child:
            self._wait(child, about)
        else:
            self._play(work)

    def _play(self, work: Callable[[], None]) -> NoReturn:
        """To its end, and what was found is noted."""
        code = 1
        try:
            work()
            code = 0
        except Violation:
            self._note(self.stage.findings[0])
        except Spinning as error:
            self._note(Finding("Everybody waits now and then.", str(error)))
        except Exception:  # noqa: BLE001 - whoever wrote this wants to see it
            traceback.print_exc()
            code = 2
        finally:
            self._count()
            os._exit(code)

    def _count(self) -> None:
        shared, runtime = self.shared, self.stage.runtime
        shared.add(Count.RUNS)
        shared.add(Count.STEPS, runtime.steps)
        shared.add(Count.VIRTUAL_MS, (runtime.now_ns - START_NS) // 1_000_000)
        if shared.is_new(hash((self.scene.name, self.player.order))):
            shared.add(Count.ORDERS)

    def _note(self, finding: Finding) -> None:
        self._report(self.player.order, finding, self.stage.frames)

    def _report(self, order: Order, finding: Finding, frames: Sequence[Sent]) -> None:
        after_s = time.time() - self.options.begun
        note(self.options.reports, Found.of(self.scene.name, order, finding, frames, after_s))

    def _wait(self, child: int, order: Order) -> None:
        _pid, status = os.waitpid(child, 0)
        if os.WIFSIGNALED(status) or os.waitstatus_to_exitcode(status) not in (0, 1):
            finding = Finding("Every run comes to its end.", f"the run ended with status {status}")
            self._report(order, finding, ())
