"""What a minute of a wearer's walk teaches the shipped gait phase, as the window learns it, and its cost.

    python -m tests.bench adapt_live            # six wearers: a minute and a half of processor
    python -m tests.bench adapt_live --quick    # one

Simulated wearers whom the shipped model has not met walk as a robot's feed tells it, faster than real time.
Both models are judged on the steps after the minute: against the strikes that the insoles show, which is
what the window offers by, and against the simulator's truth, which no robot knows.
"""

import sys
import time
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from hil_sim.channels import UNITS
from hil_sim.exoskeleton import Exoskeleton
from hil_sim.truth import phases
from ml.benchmarks import metrics
from ml.benchmarks.phase import percent
from ml.registry.registry import SHIPPED, Registry
from ml.robot.learned import Learned
from ml.robot.task import SIDES
from server_gui.core.follow.events import Telemetry
from server_gui.core.prediction.adaptation import GAIT_PHASE, LEARNED_S, TRIED_S, Tried
from server_gui.core.prediction.model_loading import Model
from server_gui.core.prediction.robot_predictor import Watched
from server_gui.core.prediction.training_data import Row, TrainingData, learn, tried
from server_gui.core.settings.prediction import PredictionSettings
from tests.unit.evidence.walks import walk

PEOPLE: Final = (101, 102, 103, 104, 105, 106)
WALK_S: Final = 120.0

Floats = npt.NDArray[np.float64]


@dataclass(slots=True)
class Truth:
    """Where both legs really were, of a robot that is listened to from its first second on."""

    stamps_ns: list[int]
    phases: list[tuple[float | None, float | None]]

    def each_s(self, robot: Exoskeleton, now_s: float) -> None:
        """Listen from now on."""
        if now_s == 1.0:
            robot.measured.append(lambda: self._note(robot))

    def _note(self, robot: Exoskeleton) -> None:
        self.stamps_ns.append(robot.clock.now_ns)
        left, right = phases(robot.controller.generator)
        self.phases.append((left, right))

    def at(self, rows: list[Row]) -> Floats:
        """The phases (n, 2) at these rows' instants, to a hundredth of a second."""
        known = np.array(self.phases, np.float64)
        return known[np.searchsorted(self.stamps_ns, [row.stamp_ns for row in rows], side="right") - 1]


def main() -> int:
    """Exit code: 1 where the window would not offer what was learned from some wearer."""
    people = PEOPLE[:1] if "--quick" in sys.argv else PEOPLE
    base = shipped()
    sys.stdout.write(f"{base.card.id}: RMS error in % of the stride, before -> after a minute\n")
    with threadpool_limits(1):
        offered = [judged(base, person) for person in people]
    return int(not all(offered))


def shipped() -> Model:
    """The general model of a robot with every sensor."""
    registry = Registry(SHIPPED.as_uri())
    name = registry.serving(GAIT_PHASE, channels=set(UNITS))
    assert name is not None, "no model of gait_phase is shipped"
    card, state = registry.load(name)
    return Model(card, Learned.restored(state), "simulated")


def judged(base: Model, person: int) -> bool:
    """Let one wearer walk, and say what came of it; whether it would be offered."""
    every_ns = PredictionSettings().every_ns(GAIT_PHASE)
    watched, lesson, truth = Watched(base, every_ns, ()), TrainingData(base, every_ns), Truth([], [])
    adapted, learned_s, followed_s = None, 0.0, 0.0
    for event in walk(WALK_S, seed=person, person=person, each_s=truth.each_s):
        if not isinstance(event, Telemetry):
            continue
        watched.take(event.batch)
        began_s = time.process_time()
        lesson.ask(watched.due)
        watched.due = []
        lesson.see(event.batch)
        followed_s += time.process_time() - began_s
        if adapted is None and lesson.stepped_s >= LEARNED_S:
            began_s = time.process_time()
            adapted = learn(base, "exo-01", f"P{person}", lesson.rows, lambda: None)
            learned_s = time.process_time() - began_s
            lesson.turn_page()
        elif adapted is not None and lesson.stepped_s >= TRIED_S:
            found, is_better = tried(base, adapted, lesson.rows)
            tell(person, found, lesson.rows, truth.at(lesson.rows), (base, adapted), (learned_s, followed_s))
            return is_better
    sys.stdout.write(f"wearer {person}: too few steps in {WALK_S:g} s\n")
    return False


def tell(
    person: int,
    found: Tried,
    rows: list[Row],
    truth: Floats,
    models: tuple[Model, Model],
    cpu_s: tuple[float, float],
) -> None:
    """Print one wearer's line."""
    really = [percent(errors(model, rows, truth).ravel()) for model in models]
    sys.stdout.write(
        f"wearer {person}: {found.text} by the insoles' strikes ({found.strides} strides), "
        f"{really[0]:.1f} -> {really[1]:.1f} % by the truth; "
        f"learning took {cpu_s[0]:.2f} s of processor, following {cpu_s[1]:.2f} s\n"
    )


def errors(model: Model, rows: list[Row], truth: Floats) -> Floats:
    """Of both legs' phases (n, 2), as a share of the stride."""
    verdicts = model.learned.judge(np.concatenate([row.features for row in rows]))
    return metrics.circular_error(np.stack([verdicts.values[side] for side in SIDES], axis=1), truth)


if __name__ == "__main__":
    sys.exit(main())
