"""Plays an order of events on a stage, written down so that it can be played again.

An order is a list of events, each so many steps after the one before.
"""

import random
from collections.abc import Iterable, Sequence

from tests.explore.events import EVENTS, Event
from tests.explore.stage import Stage

Order = tuple[tuple[int, str], ...]

NEVER = 1 << 62
# How far apart events come in a random run: a step, some steps, many; `None`: when all is quiet.
GAPS: tuple[tuple[int | None, float], ...] = ((4, 1), (40, 4), (400, 3), (2500, 1), (None, 2))
LONGEST_S = 30.0


class Player:
    """One run's order so far."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.order: Order = ()
        self._runtime = stage.runtime
        self._mark = stage.runtime.steps
        self._runtime.attention = NEVER

    def do(self, event: Event) -> None:
        """Let it happen now. In the hub, at a step."""
        self.order = (*self.order, (self._runtime.steps - self._mark, event.name))
        self._mark = self._runtime.steps
        event.act(self.stage)
        self.stage.happened()

    def replay(self, order: Iterable[tuple[int, str]]) -> None:
        """Let them happen as they did, then let all come to its end."""
        for gap, name in order:
            self._after(gap, [EVENTS[name]], random.Random(0))
        self.stage.end()

    def improvise(self, source: random.Random, count: int, events: Sequence[Event]) -> None:
        """So many events at random, then its end."""
        gaps, weights = zip(*GAPS, strict=True)
        for _ in range(count):
            most = source.choices(gaps, weights)[0]
            if most is None:
                self.stage.settle(4.0)
            gap = source.randint(1, most or 1)
            if most is None:
                gap += self._runtime.steps - self._mark
            self._after(gap, events, source)
        self.stage.end()

    def _after(self, gap: int, events: Sequence[Event], source: random.Random) -> None:
        """One of the events that are possible then."""
        happened = False

        def act() -> None:
            nonlocal happened
            happened = True
            self._runtime.attention = NEVER
            possible = [event for event in events if event.possible(self.stage)]
            if possible:
                weights = [event.weight for event in possible]
                self.do(source.choices(possible, weights)[0])

        self._runtime.at_attention = act
        self._runtime.attention = self._mark + gap
        self.stage.run_for(LONGEST_S, lambda: happened)


def written(scene: str, order: Order) -> str:
    """As `--replay` takes it."""
    return f"{scene}: " + "; ".join(f"{gap} {name}" for gap, name in order)


def parsed(text: str) -> tuple[str, Order]:
    """The scene and the order that `written` wrote."""
    scene, _, rest = text.partition(":")
    parts = (part.strip().partition(" ") for part in rest.split(";") if part.strip())
    return scene.strip(), tuple((int(gap), name) for gap, _, name in parts)
