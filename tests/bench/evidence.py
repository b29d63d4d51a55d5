"""Whether evidence for an edit is right: on simulated wearers, faster than real time.

    python -m tests.bench evidence            # 50 walks: a quarter of an hour on two cores
    python -m tests.bench evidence --quick    # 4 walks

Each walk is another wearer with strides and noise of its own; in every second one the friction of all
bearings grows by a fifth a minute. In each there are three edits, a minute apart: one of nothing (the speed
of profile moves, in which nobody walks), a position gain that is a fifth too low (the joint's tracking error
must be *worse*), and another cycle time (the cadence must have *changed*). Every metric that is said to
differ after an edit of nothing is an error.
"""

import collections
import json
import os
import sys
import time
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Final

from server_gui.core.evidence.comparison import Evidence, Word
from server_gui.core.evidence.file import EditEvidence
from server_gui.core.evidence.robot_evidence import RobotEvidence
from tests.support.desk import JOINTS
from tests.unit.evidence.walks import CYCLE_TIME, GAIN, SPEED, Edit, walk, warming

WALKS, QUICK = 50, 4
APART_S: Final = 60.0
LESS_GAIN, MORE_CYCLE_S = 2400.0, 1.8  # of 3000 N·m/rad and 1.6 s
LEAST_RIGHT, MOST_WRONG, MOST_SHARE = 0.95, 0.05, 0.05
DIFFER: Final = frozenset({Word.BETTER, Word.WORSE, Word.CHANGED})


@dataclass(frozen=True, slots=True)
class Walked:
    """What was said of each edit of one walk, and what that cost."""

    joint: str
    said: dict[str, Evidence]  # by parameter
    share: float  # of a core, as live


def main() -> int:
    """Exit code: 1 where more is wrong, or it costs more, than must be."""
    walks = QUICK if "--quick" in sys.argv else WALKS
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        return judge(pool.map(walked, range(walks)))


def walked(number: int) -> Walked:
    """Follow one walk as a desk does, with a look at the evidence each second."""
    joint = JOINTS[number % len(JOINTS)]
    edits = [
        Edit(APART_S, f"{joint}.{SPEED}", 2.0),
        Edit(2 * APART_S, f"{joint}.{GAIN}", LESS_GAIN),
        Edit(3 * APART_S, CYCLE_TIME, MORE_CYCLE_S),
    ]
    events = walk(
        4 * APART_S, seed=1000 + number, person=number, edits=edits, each_s=warming if number % 2 else None
    )
    robot, took_s = RobotEvidence("exo-01"), 0.0
    newest: dict[str, Evidence] = {}
    for turn, event in enumerate(events):
        began_s = time.process_time()
        told: Iterable[EditEvidence] = robot.take(event)
        told = [*told, *(robot.look() if turn % 10 == 0 else ())]
        took_s += time.process_time() - began_s
        newest |= {one.edit.names: one.evidence for one in told}
    newest |= {one.edit.names: one.evidence for one in robot.end()}
    return Walked(joint, newest, took_s / (4 * APART_S))


def judge(walks: Iterable[Walked]) -> int:
    """Count what is right, and say it."""
    right: collections.Counter[str] = collections.Counter()
    shares, number, falsely = [], 0, 0
    for number, one in enumerate(walks, 1):
        words = {
            name.rpartition(".")[2]: {found.series: found.word for found in evidence.metrics}
            for name, evidence in one.said.items()
        }
        wrong = [series for series, word in words[SPEED].items() if word in DIFFER]
        elsewhere = [
            series
            for series, word in words[GAIN].items()
            if word in DIFFER and not series.startswith(one.joint)
        ]
        right["nothing"] += not wrong
        right["gain"] += words[GAIN][f"{one.joint}.error_rms"] is Word.WORSE
        right["cycle time"] += words["cycle_time"]["cadence"] is Word.CHANGED
        falsely += bool(elsewhere)
        shares.append(one.share)
        if wrong or elsewhere:
            sys.stdout.write(f"walk {number}: {', '.join(wrong + elsewhere)}\n")
    figures = {name: round(right[name] / number, 3) for name in ("nothing", "gain", "cycle time")}
    more = {
        "walks": number,
        "gain_elsewhere": round(falsely / number, 3),
        "core_percent": round(100 * max(shares), 2),
    }
    sys.stdout.write(json.dumps({"right": figures, **more}) + "\n")
    known = (
        min(figures["gain"], figures["cycle time"]) >= LEAST_RIGHT and 1 - figures["nothing"] <= MOST_WRONG
    )
    return int(not known or max(shares) > MOST_SHARE)


if __name__ == "__main__":
    sys.exit(main())
