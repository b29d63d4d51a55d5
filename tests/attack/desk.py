"""Robots that lie, against the desk's collector, beside one that does not: who is told, and what is lost.

One collector a lie (`tests/unit/fleet/test_lies.py`), in this process. The honest robot's rows must be in the
recording exactly once, and nothing of the liar's under a name that it never described.
"""

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from tests.attack.attack import Lengths, Result
from tests.fake_robot import FakeRobot
from tests.unit.fleet.recording import Kept, recording
from tests.unit.fleet.test_lies import LIES, Spoil

COLUMNS = ("lies", "told", "told in s, at most", "honest rows kept", "holes", "foreign names")


@dataclass(frozen=True)
class _Found:
    told_s: float | None  # how soon the link said what is wrong
    rows: int
    whole: bool
    foreign: int  # names in the recording that the honest robot did not describe


@dataclass(frozen=True)
class LyingRobots:
    """Each lie after the other."""

    name: str = "robots"
    about: str = "robots that lie, against the collector"

    def measure(self, lengths: Lengths) -> Result:
        found = {lie: _one(spoil, words, lengths.after_s) for lie, (spoil, words) in LIES.items()}
        told = [one.told_s for one in found.values() if one.told_s is not None]
        holes, foreign = sum(not one.whole for one in found.values()), sum(o.foreign for o in found.values())
        cells = (
            f"{len(found)}",
            f"{len(told)}",
            f"{max(told, default=float('nan')):.1f}",
            f"{sum(one.rows for one in found.values())}",
            f"{holes}",
            f"{foreign}",
        )
        broken = [f"{lie}: not told" for lie, one in found.items() if one.told_s is None]
        broken += [f"{lie}: rows of another are lost" for lie, one in found.items() if not one.whole]
        broken += [f"{lie}: foreign names are kept" for lie, one in found.items() if one.foreign]
        first = next(iter(LIES.values()))[1]
        return Result(self.name, COLUMNS, cells, tuple(broken), f"on its link, such as: {first}")


def _one(spoil: Spoil, words: str, within_s: float) -> _Found:
    with FakeRobot() as bad, FakeRobot() as good, tempfile.TemporaryDirectory() as folder:
        described = set(good.values())
        spoil(bad)
        path, began, told_s = Path(folder), time.monotonic(), None
        with recording(path, {"bad": bad.address, "good": good.address}) as fleet:

            def told() -> bool:
                link = fleet.fleet.report()["bad"]
                return any(words in reason for reason in (*link.quality.reasons, link.problem or ""))

            while told_s is None and time.monotonic() < began + within_s:
                if told():
                    told_s = time.monotonic() - began
                time.sleep(0.02)
            fleet.until_more("good")
            fleet.recorder.flush(20)
        kept = Kept.of(path)
        names = {name for run in kept.runs for name in run.layout.channels}
        return _Found(told_s, len(kept.rows("good")), kept.is_whole("good"), len(names - described))


ATTACKS = (LyingRobots(),)
