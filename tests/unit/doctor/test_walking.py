"""Ten minutes of walking, of five wearers, raise no false alarm and are judged all the time."""

import random
from collections.abc import Iterator
from dataclasses import replace

import msgspec
import pytest

from gateway.doctor.observations import Observations, Samples
from gateway.doctor.rules import motion, trunk
from gateway.doctor.verdicts import Finding, Unknown, Verdict
from hil_sim.gait.activity import Activity
from hil_sim.gait.generator import Generator
from hil_sim.gait.subject import subject
from hil_sim.gait.walk import Shape
from hil_sim.gait.wearer import Wearer
from hil_sim.sensors.trunk_imu import specific_force
from tests.unit.doctor.patient import Patient

PERIOD_S = 0.04
WINDOW = round(20 / PERIOD_S)
MINUTES = 2
WEARERS = (0, 3, 6, 11, 17)
SHAPE = Shape(0.4, 1.8, 0.05, 0.05)
JUDGES = (motion.gear, motion.sign, motion.sides, motion.zero, motion.insole_scale, trunk.imu)


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Observations:
    """A robot of which nothing moves yet."""
    return Patient(tmp_path_factory.mktemp("standing"), seconds=0.1, warm_s=0.2).seen()


def walked(person: int, activity: Activity) -> dict[str, list[float]]:
    """What sensors without noise would tell of minutes of it."""
    generator = Generator(SHAPE, subject(person), random.Random(person))
    wearer = Wearer(generator)
    columns: dict[str, list[float]] = {}
    for step in range(round(MINUTES * 60 / PERIOD_S) + WINDOW // 2):
        generator.step(PERIOD_S, activity, SHAPE)
        for name, value in moment(generator, wearer, step * PERIOD_S):
            columns.setdefault(name, []).append(value)
    return {name: column[WINDOW // 2 :] for name, column in columns.items()}


def moment(generator: Generator, wearer: Wearer, now_s: float) -> Iterator[tuple[str, float]]:
    for side, leg, foot in zip(("left", "right"), generator.legs(), wearer.feet(now_s), strict=True):
        yield f"{side}_hip.position", leg.hip
        yield f"{side}_knee.position", leg.knee
        yield f"{side}_ankle.position", leg.ankle
        yield f"{side}_insole.force", foot.force
    for axis, value in zip("xyz", specific_force(wearer.trunk(now_s)), strict=True):
        yield f"trunk.acceleration_{axis}", value


def windows(seen: Observations, columns: dict[str, list[float]]) -> Iterator[Observations]:
    for begin in range(0, len(columns["left_hip.position"]) - WINDOW + 1, WINDOW):
        cut = {name: tuple(column[begin : begin + WINDOW]) for name, column in columns.items()}
        yield replace(seen, samples=Samples(PERIOD_S, cut))


def judged(seen: Observations) -> list[Verdict]:
    return [verdict for judge in JUDGES for verdict in judge(seen)]


@pytest.mark.parametrize("person", WEARERS)
def test_two_minutes_of_a_wearers_walking_raise_no_alarm(person: int, standing: Observations) -> None:
    seen = list(windows(standing, walked(person, Activity.WALK)))
    assert len(seen) == MINUTES * 3
    assert [judged(one) for one in seen] == [[]] * len(seen)


def test_two_minutes_of_standing_raise_no_alarm_and_are_not_called_well(standing: Observations) -> None:
    for one in windows(standing, walked(0, Activity.STAND)):
        verdicts = judged(one)
        assert not any(isinstance(verdict, Finding) for verdict in verdicts)
        rules = {verdict.rule for verdict in verdicts if isinstance(verdict, Unknown)}
        assert rules == {"gear", "sign", "sides", "zero", "insole_scale", "imu"}


def test_a_wearer_with_one_weak_leg_who_turns_is_not_called_a_wrong_gear(standing: Observations) -> None:
    for one in windows(standing, walked(6, Activity.TURN_LEFT)):
        assert not any(isinstance(verdict, Finding) for verdict in motion.gear(one))


def test_a_robot_without_insoles_is_told_that_none_was_judged(standing: Observations) -> None:
    bare = replace(standing, config=msgspec.structs.replace(standing.config, insole={}))
    verdicts = list(motion.insole_scale(bare))
    assert verdicts == [Unknown("insole_scale", "insoles", "the robot has none")]
