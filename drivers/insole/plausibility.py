"""Plausibility of an insole: stuck or dead cells, a scale off by ten, swapped feet.

Everything is judged over steps, so that standing, sitting and a foot in the air say nothing.
"""

import math
from collections.abc import Sequence
from typing import cast

from drivers.findings import FindingState, active_findings
from drivers.samples import Finding

STEPS = 10  # landings that make a window
FORCE_SWING = 150.0  # N; a foot that steps loads and unloads by at least this
DEAD_SHARE = 0.01  # of the hardest pressed cell
LOW_PEAK, HIGH_PEAK = 200.0, 4000.0  # N under one foot of somebody who walks
FROZEN_S = 10.0
PERIOD_NS = 39_000_000  # faster frames are left out: a foot's load does not change faster
ALONE_S = 30.0
JUMPS = 20  # in a window: a loose wire
JUMP_SHARE = 0.5  # of the hardest pressed cell, from one frame to the next and back


class StepDetector:
    """Finds landings in a foot's force whatever its scale and offset: a rise by half of the recent peak."""

    SOONEST_S = 0.4  # between two landings of one foot
    PEAK_FADES_S = 20.0
    LEAST_RISE = 20.0  # N

    def __init__(self) -> None:
        self._peak = 0.0
        self._extreme: float | None = None
        self._rising = True
        self._last_ns = self._landed_ns = 0

    def has_landed(self, stamp_ns: int, force: float) -> bool:
        """Return whether this frame shows a landing."""
        fade = min(1.0, (stamp_ns - self._last_ns) / 1e9 / self.PEAK_FADES_S)
        self._peak = max(force, self._peak * (1.0 - fade))
        self._last_ns = stamp_ns
        if self._extreme is None:
            self._extreme = force
        self._extreme = (max if self._rising else min)(self._extreme, force)
        turn = max(self.LEAST_RISE, 0.5 * self._peak)
        if abs(force - self._extreme) < turn:
            return False
        self._rising, self._extreme = not self._rising, force
        if not self._rising or stamp_ns - self._landed_ns < self.SOONEST_S * 1e9:
            return False
        self._landed_ns = stamp_ns
        return True


class FootCheck:
    """Watches one foot's cells and force."""

    def __init__(self, name: str, cells: int) -> None:
        self._name = name
        self._cells = cells
        self._frozen, self._stepped = FindingState(), FindingState()
        self.restart()

    def restart(self) -> None:
        """Restart with the stream."""
        self.landings = 0
        self._steps = StepDetector()
        self._frozen.clear()
        self._stepped.clear()
        self._frozen_since_ns: int | None = None
        self._previous: Sequence[float] | None = None
        self._before: Sequence[float] | None = None
        self._last_ns = 0
        self._force_low = self._force_high = 0.0
        self._clear_window()

    def is_due(self, stamp_ns: int) -> bool:
        """Return whether to judge a frame of this time: at most one each `PERIOD_NS` is."""
        return not 0 <= stamp_ns - self._last_ns < PERIOD_NS

    def update(self, stamp_ns: int, pressures: Sequence[float | None], force: float | None) -> None:
        """One frame that is due."""
        if force is None or None in pressures or len(pressures) != self._cells:
            return
        known = cast("Sequence[float]", pressures)
        if known != self._previous or force <= 0.0:
            self._frozen_since_ns = stamp_ns
        self._judge_frozen(stamp_ns)
        self._note(known)
        self._before, self._previous, self._last_ns = self._previous or known, known, stamp_ns
        self._force_low = min(self._force_low, force)
        self._force_high = max(self._force_high, force)
        if self._steps.has_landed(stamp_ns, force):
            self._land(stamp_ns)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Problems, with what to check."""
        return active_findings((self._frozen, self._stepped))

    def _judge_frozen(self, stamp_ns: int) -> None:
        since_ns = self._frozen_since_ns
        if since_ns is None or stamp_ns - since_ns <= FROZEN_S * 1e9:
            self._frozen.clear()
            return
        self._frozen.note(
            since_ns,
            f"{self._name} sends the same values again and again under load: its cells are unplugged "
            "or its converter hangs",
            "check the cells' connector and restart it",
        )

    def _land(self, stamp_ns: int) -> None:
        self.landings += 1
        if self.landings % STEPS == 0:
            if self._force_high - self._force_low >= FORCE_SWING or self._force_high < LOW_PEAK:
                self._tell(stamp_ns, self._judge())
            self._clear_window()

    def _tell(self, stamp_ns: int, wrong: tuple[str, str] | None) -> None:
        if wrong is None:
            self._stepped.clear()
        else:
            self._stepped.note(stamp_ns, *wrong)

    def _judge(self) -> tuple[str, str] | None:
        """Return the implausibility of this window's steps, and what to check."""
        hardest = max(self._high)
        if self._force_high < LOW_PEAK or self._force_high > HIGH_PEAK:
            most = f"{self._name} measured at most {self._force_high:.0f} N over {STEPS} steps"
            check = "check the calibration's gain and the cells' areas"
            return f"{most}: its scale is off, perhaps by ten", check
        for cell, jumps in enumerate(self._jumps):
            if jumps >= JUMPS:
                return f"{self._name}: cell {cell} jumps between two values", "check it for a loose wire"
        for cell, (low, high) in enumerate(zip(self._low, self._high, strict=True)):
            if low == high > 0.0:
                return f"{self._name}: cell {cell} is stuck at {high / 1e3:.1f} kPa", "check its wire"
            if high < DEAD_SHARE * hardest:
                return (
                    f"{self._name}: cell {cell} felt nothing over {STEPS} steps",
                    "check its wire and place",
                )
        return None

    def _note(self, known: Sequence[float]) -> None:
        """Each cell's range in this window, and how often it went far away and came back."""
        low, high = self._low, self._high
        far = JUMP_SHARE * max(high)
        earlier, last = self._before or known, self._previous or known
        for cell, (a, b, c) in enumerate(zip(earlier, last, known, strict=True)):
            if c < low[cell]:
                low[cell] = c
            if c > high[cell]:
                high[cell] = c
            if (b - a) * (c - b) < 0.0 and min(abs(b - a), abs(c - b)) > far > 0.0:
                self._jumps[cell] += 1

    def _clear_window(self) -> None:
        self._low, self._high = [math.inf] * self._cells, [0.0] * self._cells
        self._force_low, self._force_high = math.inf, 0.0
        self._jumps = [0] * self._cells


class FeetCheck(FindingState):
    """Watches one foot against the other: both must step."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self._name = name
        self.restart()

    def restart(self) -> None:
        self.clear()
        self._own = self._others = 0
        self._since_ns = 0

    def update(self, stamp_ns: int, own_landings: int, others_landings: int) -> None:
        """Take the numbers of both feet's landings by `stamp_ns`."""
        if own_landings != self._own or stamp_ns - self._since_ns > ALONE_S * 1e9:
            if own_landings != self._own:
                self.clear()
            self._own, self._others, self._since_ns = own_landings, others_landings, stamp_ns
        elif others_landings - self._others >= STEPS:
            self.note(
                self._since_ns,
                f"{self._name} sends, but does not feel the steps that the other foot makes",
                "check the cells' connector and that the insole lies in the shoe",
            )


class SwapCheck(FindingState):
    """Watches the feet's force against the hips: a loaded leg's hip extends, a free leg's hip flexes."""

    SETTLED_S = 15.0
    CORRELATION = 0.3
    LEAST_FORCE, LEAST_VELOCITY = 80.0, 0.25  # rms of somebody who walks, N and rad/s

    def __init__(self) -> None:
        super().__init__()
        self.restart()

    def restart(self) -> None:
        self.clear()
        self._force2 = self._velocity2 = self._product = 0.0
        self._began_ns: int | None = None
        self._last_ns = 0

    def update(self, stamp_ns: int, force_difference: float, velocity_difference: float) -> None:
        """One leg minus the other: force (N) and hip velocity (rad/s, flexion positive)."""
        if self._began_ns is None or stamp_ns - self._last_ns > 1e9:
            self.restart()
            self._began_ns = self._last_ns = stamp_ns
        step_s = (stamp_ns - self._last_ns) / 1e9
        self._last_ns = stamp_ns
        keep = math.exp(-step_s / self.SETTLED_S)
        self._force2 = keep * self._force2 + (1 - keep) * force_difference**2
        self._velocity2 = keep * self._velocity2 + (1 - keep) * velocity_difference**2
        self._product = keep * self._product + (1 - keep) * force_difference * velocity_difference
        if stamp_ns - self._began_ns > 2 * self.SETTLED_S * 1e9:
            self._judge(stamp_ns)

    def _judge(self, stamp_ns: int) -> None:
        force, velocity = math.sqrt(self._force2), math.sqrt(self._velocity2)
        if force < self.LEAST_FORCE or velocity < self.LEAST_VELOCITY:
            return
        correlation = self._product / (force * velocity)
        if correlation > self.CORRELATION:
            self.note(
                stamp_ns,
                "left and right are swapped, each foot is loaded while its own hip flexes",
                "check the insoles' ports (and the sign of the hips' `direction`)",
            )
        elif correlation < 0.0:
            self.clear()
