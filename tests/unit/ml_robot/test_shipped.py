"""The models that come with GWRMS: sound, small, said to be simulated, and right about a robot made anew."""

from pathlib import Path

import numpy as np
import pytest

from hil_sim.channels import UNITS, reported
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.gait.activity import Activity
from hil_sim.gait.gaits import LEFT, RIGHT
from hil_sim.gait.timetable import Entry
from ml.registry.card import DataSource
from ml.registry.registry import SHIPPED, Registry
from ml.robot.groups import unit
from ml.robot.learned import Learned
from ml.robot.task import STRIDE, TASKS
from ml.serving.predictor import Prediction, replayed
from ml.training.shipping import held_out
from ml.training.simulated import SimulatedSession

PERSON = 77  # whom no model has seen
PACE = (0.47, 1.2)  # another one than usual
S = 10**9


def serving(registry: Registry, task: str) -> str:
    model = registry.serving(task, channels=set(UNITS))
    assert model is not None, f"no {task} is shipped: ./dev models makes it"
    return model


@pytest.fixture
def registry(tmp_path: Path) -> Registry:
    return Registry(tmp_path.as_uri())


@pytest.mark.parametrize("task", TASKS)
def test_a_robot_without_models_is_served_by_a_sound_one_that_says_simulated(
    task: str, registry: Registry
) -> None:
    card, state = registry.load(serving(registry, task))
    learned = Learned.restored(state)
    assert card.source is DataSource.SIMULATED
    assert card.robot == ""
    assert card.classes == learned.classes == TASKS[task].classes(learned.recipe)
    assert card.units == {name: unit(name) for name in learned.recipe.channels} == _units(card.channels)
    assert card.held_out
    assert not set(card.held_out) & set(card.learned)
    assert set(card.ranges) == set(card.channels)
    assert card.metrics.per_subject


def _units(channels: tuple[str, ...]) -> dict[str, str]:
    return {name: UNITS[name] for name in channels}


def test_one_in_four_of_those_who_walk_alike_is_held_out_of_all_of_his_walks() -> None:
    walks = {"ordinary": range(1, 9), "crouch": (17, 18, 19, 20, 8), "slow": (21, 22, 23)}
    sessions = [_session(str(person), name) for name, people in walks.items() for person in people]
    assert held_out(sessions) == {"4", "8", "19"}


def _session(person: str, walks: str) -> SimulatedSession:
    return SimulatedSession(
        "", person, (), np.zeros(0, np.int64), np.zeros((0, 0)), np.zeros(0, str), np.zeros((0, 2)), walks
    )


def test_they_are_small() -> None:
    assert sum(file.stat().st_size for file in SHIPPED.rglob("*.*")) < 2_000_000


class Walk:
    """Somebody new stands, walks at another pace than usual, falls: what a gateway reports, and the truth."""

    def __init__(self) -> None:
        robot = Exoskeleton(Scenario.STAND, seed=9, person=PERSON)
        self.stamps: list[int] = []
        self.values: list[list[float]] = []
        self.labels: list[str] = []
        self.phases: list[tuple[float, float]] = []
        robot.measured.append(lambda: self._take(robot))
        robot.power_on()
        robot.follow([Entry(Activity.STAND, 4.0), Entry(Activity.WALK, 9.0, PACE), Entry(Activity.FALL, 4.0)])
        robot.clock.run_until(16 * S)

    def _take(self, robot: Exoskeleton) -> None:
        generator = robot.controller.generator
        self.stamps.append(robot.clock.now_ns)
        self.values.append([np.nan if value is None else value for value in reported(robot)])
        self.labels.append(str(generator.label))
        self.phases.append((generator.leg_phase(LEFT), generator.leg_phase(RIGHT)))

    def judged(self, registry: Registry, task: str) -> list[Prediction]:
        model = serving(registry, task)
        learned = Learned.restored(registry.load(model)[1])
        columns = [list(UNITS).index(name) for name in learned.recipe.channels]
        values = np.array(self.values)[:, columns]
        return replayed(model, learned, np.array(self.stamps, dtype=np.int64), values, S // 25)

    def at(self, one: Prediction, delay_ms: int = 0) -> int:
        """The row of the moment that a prediction is about."""
        return int(np.searchsorted(self.stamps, one.stamp_ns - delay_ms * 10**6))


def test_somebody_new_at_another_pace_is_told_right(registry: Registry) -> None:
    walk = Walk()
    activity = [
        (walk.labels[walk.at(one, TASKS["activity"].delay_ms)], one.label)
        for one in walk.judged(registry, "activity")
    ]
    for label in ("stand", "walk"):
        said = [word for truth, word in activity if truth == label]
        assert said.count(label) > 0.85 * len(said), (label, said)
    lying = [word for truth, word in activity if truth == "lying"]
    assert lying.count("abnormal") > 0.9 * len(lying)

    steps = [one for one in walk.judged(registry, "gait_phase") if walk.labels[walk.at(one)] == "walk"]
    errors = [
        (one.values[side] - walk.phases[walk.at(one)][leg] + 0.5) % 1.0 - 0.5
        for one in steps
        for leg, side in enumerate(("left", "right"))
    ]
    assert np.sqrt(np.mean(np.square(errors))) < 0.06
    assert [one.label for one in steps].count(STRIDE) > 0.9 * len(steps)

    falling = walk.judged(registry, "falling")
    risk = {one.stamp_ns: one.probabilities["fall"] + one.probabilities["near_fall"] for one in falling}
    impact = walk.stamps[walk.labels.index("lying")]
    begin = walk.stamps[walk.labels.index("fall")]
    assert max(risk[at] for at in risk if at < begin) < 0.9
    assert max(risk[at] for at in risk if begin <= at < impact - 300 * 10**6) >= 0.9
