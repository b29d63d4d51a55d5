"""How far a simulated robot is on its way to its first step, for the terminal and for the splash."""

import time
from collections.abc import Callable, Sequence
from enum import Enum
from typing import Final

STARTS: Final = "The simulated robot is starting; this takes a few seconds …"


class FirstStep(Enum):
    """What has to be so before a robot walks in the window, in the order in which people expect it."""

    SIMULATOR = "Simulator: six drives, two insoles, an IMU"
    GATEWAY = "Gateway: what runs on a robot's computer"
    WINDOW = "Window"
    DATA = "First data from every component"
    WALK = "The robot walks"


class FirstSteps:
    """Each step counts once; `told` hears of it with the seconds since the beginning."""

    def __init__(
        self,
        told: Callable[[FirstStep, float], None] = lambda _step, _seconds: None,
        steps: Sequence[FirstStep] = tuple(FirstStep),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.steps = tuple(steps)
        self.took_s: dict[FirstStep, float] = {}
        self._told = told
        self._clock = clock
        self._began_s = clock()

    @property
    def elapsed_s(self) -> float:
        """Since the beginning."""
        return self._clock() - self._began_s

    @property
    def is_over(self) -> bool:
        """Whether nothing is missing any more."""
        return all(step in self.took_s for step in self.steps)

    @property
    def now(self) -> FirstStep | None:
        """The first that is missing."""
        return next((step for step in self.steps if step not in self.took_s), None)

    def reach(self, step: FirstStep) -> None:
        """Note that this is so."""
        if step in self.steps and step not in self.took_s:
            self.took_s[step] = self.elapsed_s
            self._told(step, self.took_s[step])
