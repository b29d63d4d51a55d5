"""`./dev bench predict`: from a robot's samples to a prediction, for one robot and for fifty in one batch.

First the models of the benchmarks, then a robot's own, on their way through a server: row, grid, window,
features, judging. `danger` is a row of all its channels, once its memory is full; it knows no batches:
fifty robots take fifty times as long, which is told and not limited. The time is what this thread used of a
core, so that other work does not count; and a busy computer's caches do not either: what is allowed is a
multiple of a yardstick in the same run, which is scikit-learn's plain `predict` of trees and one network on
two seconds, of one row and of fifty.
"""

import copy
import functools
import math
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace
from scipy.special import softmax
from threadpoolctl import threadpool_limits

from ml.benchmarks.models.falling import FallSettings, fall_trees
from ml.benchmarks.models.gait_phase import PhaseModel, PhaseSettings
from ml.benchmarks.models.gait_status import StatusSettings, status_model
from ml.benchmarks.models.quick import QuickTerrain, outputs, scaled_rows
from ml.benchmarks.models.terrain import TerrainSettings, terrain_model
from ml.benchmarks.models.trees import QuickTrees
from ml.danger.calibration import load
from ml.danger.monitor import DangerMonitor
from ml.danger.observation import CHANNELS
from ml.features import FeatureStream, Recipe, features
from ml.features.falling import FALLING
from ml.features.gait_context import GAIT_CONTEXT
from ml.features.gait_phase import LEFT_PHASE
from ml.features.gait_status import GAIT_STATUS
from ml.features.terrain import TERRAIN
from ml.neural import fixed_epochs
from ml.robot.groups import GROUPS
from ml.robot.learn import learn
from ml.robot.learned import Learned
from ml.robot.task import TASKS, Task
from ml.serving.grid import period_ns
from ml.serving.predictor import Windows, judged
from server_gui.core.settings.prediction import Action, RuleSettings
from tests.unit.ml.serving.small import hips
from tests.unit.prediction.robots import described, predicting, promoters, publish, settings, telemetry

ROBOTS = 50
ROUNDS = 300
WARM = 20  # rounds that do not count
ONE_MS, ALL_MS = 2.0, 8.0  # the 99th percentiles that are allowed where the yardsticks are these:
YARDSTICKS_MS = (2.4, 2.9)  # medians for one row and for fifty, on a computer that does little else
PROMOTER = "tester"
LEARNED = 1800  # rows that the models have learned from
FULL = 3000  # rows after which danger's memory is full
DANGER_NS = 40_000_000

Predict = Callable[[npt.NDArray[np.float32]], Any]


def main() -> int:
    """Print the figures; 1 where one is over its limit."""
    models, yardsticks = _models()
    slower = [now / then for now, then in zip(yardsticks, YARDSTICKS_MS, strict=True)]
    allowed = (ONE_MS * slower[0], ALL_MS * slower[1])
    head = (
        f"{'recipe':<18}{'1 robot':>10}{'p99':>8}{'ratio':>8}{f'{ROBOTS} robots':>12}{'p99':>8}{'ratio':>8}"
    )
    sys.stdout.write(f"{head}   ms; p99 by scikit-learn's plain predict\n")
    lines = [(recipe.name, functools.partial(_times, recipe, predict)) for recipe, predict in models]
    lines += [(f"own {task}", functools.partial(_served, learned)) for task, learned in _own().items()]
    over = [_line(name, times, yardsticks, allowed) for name, times in lines]
    over.append(_line("danger", _watched, yardsticks, (allowed[0], math.inf)))
    sys.stdout.write(
        f"plain predict: {yardsticks[0]:.2f} and {yardsticks[1]:.2f} ms; allowed, 99th percentiles:"
        f" {allowed[0]:.2f} ms for one robot (ratio {ONE_MS / YARDSTICKS_MS[0]:.2f}),"
        f" {allowed[1]:.2f} ms for {ROBOTS} (ratio {ALL_MS / YARDSTICKS_MS[1]:.2f})\n"
    )
    half, tail = np.percentile(_stopping(), (50, 99))
    sys.stdout.write(f"rows handed over → a rule asks for a stop: {half:.1f} ms, p99 {tail:.1f} ms\n")
    return int(any(over))


Pair = Sequence[float]  # for one row, and for fifty


def _line(name: str, times: Callable[[int], list[float]], yardsticks: Pair, allowed: Pair) -> bool:
    """Print what one model takes; whether that is too much."""
    with threadpool_limits(limits=1):
        taken = [times(robots) for robots in (1, ROBOTS)]
    half, tail = np.percentile(taken, (50, 99), axis=1)
    ratios = tail / yardsticks
    sys.stdout.write(
        f"{name:<18}{half[0]:10.2f}{tail[0]:8.2f}{ratios[0]:8.2f}{half[1]:12.2f}{tail[1]:8.2f}{ratios[1]:8.2f}\n"
    )
    return bool((tail > allowed).any())


def _samples(recipe: Recipe, rows: int, seed: int) -> npt.NDArray[np.float64]:
    random = np.random.default_rng(seed)
    shape = (rows, len(recipe.channels))
    return 3.0 + random.normal(0, 1, shape).cumsum(axis=0) * 0.1


def _models() -> tuple[list[tuple[Recipe, Predict]], Pair]:
    """Each recipe with a model of full size; and the yardsticks, ms."""
    made: list[tuple[Recipe, Predict]] = []
    with fixed_epochs(), threadpool_limits(limits=1):
        for recipe in (GAIT_CONTEXT, LEFT_PHASE, FALLING, TERRAIN):
            x = features(recipe, _samples(recipe, LEARNED, 1), np.arange(LEARNED))
            made.append((recipe, _fitted(recipe, x)))
        x = features(GAIT_STATUS, _samples(GAIT_STATUS, LEARNED, 1), np.arange(LEARNED))
        vote = status_model(StatusSettings(networks=1)).fit(x, _classes(x, 3))
        yardsticks = [_median_ms(vote.predict, x[:rows]) for rows in (1, ROBOTS)]
    return made, yardsticks


def _median_ms(predict: Predict, x: npt.NDArray[np.float32]) -> float:
    times = []
    for _ in range(ROUNDS):
        began = time.thread_time()
        predict(x)
        times.append(1e3 * (time.thread_time() - began))
    return float(np.median(times))


def _classes(x: npt.NDArray[np.float32], count: int) -> npt.NDArray[np.intp]:
    """Something that can be learned, with an error: two features together, in classes of one size."""
    told = x[:, :2].sum(axis=1)
    told += 0.1 * told.std() * np.random.default_rng(0).normal(size=len(x))
    classes: npt.NDArray[np.intp] = np.digitize(told, np.quantile(told, np.arange(1, count) / count))
    return classes


def _fitted(recipe: Recipe, x: npt.NDArray[np.float32]) -> Predict:
    if recipe is LEFT_PHASE:
        phase = np.random.default_rng(0).random(len(x))
        return PhaseModel(PhaseSettings(doubtful=1.0)).fit(x, phase, np.arange(len(x))).predict
    if recipe is TERRAIN:
        return QuickTerrain(terrain_model().fit(x, _classes(x, 4)), TerrainSettings().sharpness).predict
    if recipe is FALLING:
        model = FallSettings()
        sets = [fall_trees(model).fit(x, _classes(x, 3) == one) for one in range(model.folds)]
        return QuickTrees(sets).predict_proba
    vote = status_model().fit(x, _classes(x, 3))
    trees, *networks = vote.estimators_
    quick, scale = QuickTrees([trees]), networks[0]  # the rows are scaled alike for every network

    def votes(rows: npt.NDArray[np.float32]) -> Any:
        inputs = scaled_rows(scale, rows)
        said = softmax([outputs(one[-1], inputs) for one in networks], axis=-1)
        return quick.predict_proba(rows)[0] + said.mean(axis=0)

    return votes


def _times(recipe: Recipe, predict: Predict, robots: int) -> list[float]:
    """Milliseconds from a new sample of each robot to all their predictions."""
    streams = [FeatureStream(recipe) for _ in range(robots)]
    samples = [_samples(recipe, ROUNDS + WARM, robot) for robot in range(robots)]
    times = []
    for row in range(ROUNDS + WARM):
        began = time.thread_time()
        for stream, own in zip(streams, samples, strict=True):
            stream.push(own[row])
        predict(recipe.compute(np.concatenate([stream.window() for stream in streams])))
        times.append(1e3 * (time.thread_time() - began))
    return times[WARM:]


def _own() -> dict[str, Learned]:
    """A robot's own models of full size: of a robot that has every sensor."""
    channels = {name for group in GROUPS.values() for name in group}
    return {name: _learned(task, channels) for name, task in TASKS.items()}


def _learned(task: Task, channels: set[str]) -> Learned:
    recipe = task.recipe(channels)
    assert recipe is not None
    x = features(recipe, _samples(recipe, LEARNED, 2), np.arange(LEARNED))
    random = np.random.default_rng(3)
    classes = np.array(task.classes(recipe))
    truth = classes[random.integers(0, len(classes), len(x))] if task.fold else random.random((len(x), 2))
    with threadpool_limits(limits=1):
        return learn(task, recipe, x, truth, np.arange(len(x)) % 3)


def _served(learned: Learned, robots: int) -> list[float]:
    """Milliseconds from each robot's rows until all predictions are there: a row, a decision."""
    recipe = learned.recipe
    every_ns = period_ns(recipe)
    windows = [Windows(recipe, every_ns) for _ in range(robots)]
    samples = [_samples(recipe, recipe.look_back + ROUNDS + WARM, robot) for robot in range(robots)]
    times = []
    for row in range(recipe.look_back + ROUNDS + WARM):
        began = time.thread_time()
        due = [
            window
            for own, values in zip(windows, samples, strict=True)
            for window in own.push([(row * every_ns, values[row].tolist())])
        ]
        judged("model", learned, due)
        times.append(1e3 * (time.thread_time() - began))
    return times[recipe.look_back + WARM :]


def _watched(robots: int) -> list[float]:
    """Milliseconds from a row of each robot, of somebody who walks, to what is said of danger."""
    first = DangerMonitor(load())
    for at in range(FULL):
        first.take(*_walking(at))
    watches = [copy.deepcopy(first) for _ in range(robots)]
    times = []
    for at in range(FULL, FULL + ROUNDS):
        row = _walking(at)
        began = time.thread_time()
        for one in watches:
            one.take(*row)
        times.append(1e3 * (time.thread_time() - began))
    return times


def _walking(at: int) -> tuple[int, list[float | None]]:
    """A stamp (ns) and the row of all of danger's channels; no two strides are alike."""
    phase = math.tau * at / 30.0
    swing = np.sin(phase + np.arange(len(CHANNELS))) + np.random.default_rng(at).normal(
        0, 0.03, len(CHANNELS)
    )
    row = dict(zip(CHANNELS, swing.tolist(), strict=True))
    row |= {"left_insole.force": 400.0 * (1.0 + math.sin(phase))}
    row |= {"right_insole.force": 400.0 * (1.0 - math.sin(phase))}
    return at * DANGER_NS, [row[name] for name in CHANNELS]


def _stopping() -> list[float]:
    """Milliseconds on the wall clock from handing over the rows that fill a window to the stop they cause."""
    times: list[float] = []
    rule = RuleSettings("activity", "walk", 0.5, action=Action.STOP)
    with tempfile.TemporaryDirectory() as folder:
        url = Path(folder).as_uri()
        publish(url, by=PROMOTER)  # a rule stops nothing by a model that nobody has signed
        server = replace(settings(url, rule), promoters=promoters(PROMOTER))
        with predicting(server) as (one, told):
            robots = [f"exo-{number}" for number in range(ROBOTS)]
            for robot in robots:
                one.take(robot, described())
            told.until(lambda: {(robot, "activity") for robot in robots} <= one.models.keys())
            for number, robot in enumerate(robots):
                *before, last = list(telemetry(hips(2.1, walks=True)))
                for event in before:
                    one.take(robot, event)
                began = time.monotonic()
                one.take(robot, last)
                told.until(lambda: len(told.stops) > number)  # noqa: B023 - called here alone
                times.append(1e3 * (told.stopped_s - began))
    return times
