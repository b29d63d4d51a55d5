"""Wearers who walk, each a little differently, and a small general model of where in the stride they are."""

import functools
from collections.abc import Iterator
from typing import Final

import numpy as np
from msgspec.structs import replace
from threadpoolctl import threadpool_limits

from gateway.client import Batch, ClockOffset
from gateway.wire.component import ChannelInfo
from ml.features import features
from ml.robot import learn
from ml.robot.learned import Learned
from ml.robot.task import TASKS
from ml.serving.grid import on_grid
from server_gui.core.follow.events import Described, Telemetry
from server_gui.core.prediction.model_loading import Model
from tests.unit.prediction.robots import ROBOT, card
from tests.unit.recording.robots import description

MS: Final = 1_000_000
STEP_MS: Final = 20  # between rows
ROWS: Final = 5  # of a batch
CHANNELS: Final = ("left_hip.position", "right_hip.position", "left_insole.force", "right_insole.force")
UNITS: Final = ("rad", "rad", "N", "N")
TASK: Final = TASKS["gait_phase"]
Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]


def walk(seconds: float, habit: float, seed: int = 0, stride_s: float = 1.2) -> tuple[Floats, Floats]:
    """Rows (n, 4) of the channels, and phases (n, 2). `habit`: how late the hip swings, of the stride."""
    random = np.random.default_rng(seed)
    time_s = np.arange(round(seconds * 1000 / STEP_MS)) * STEP_MS / 1000
    pace = time_s / stride_s + 0.02 * np.sin(2 * np.pi * time_s / 11.0)
    phase = np.stack([pace % 1.0, (pace + 0.5) % 1.0], axis=1)
    hips = 0.4 * np.cos(2 * np.pi * (phase - habit)) + random.normal(0, 0.01, phase.shape)
    forces = np.where(phase < 0.62, 700.0 * np.minimum(1.0, phase / 0.03), 0.0)
    return np.concatenate([hips, forces], axis=1), phase


def events(seconds: float, habit: float, seed: int = 0, begin_ms: int = 0) -> Iterator[Telemetry]:
    """The same as a feed tells it, from `begin_ms` of the robot's clock on."""
    rows, _ = walk(seconds, habit, seed)
    for at in range(0, len(rows) - ROWS + 1, ROWS):
        stamps = [(begin_ms + (at + row) * STEP_MS) * MS for row in range(ROWS)]
        columns = dict(zip(CHANNELS, rows[at : at + ROWS].T.tolist(), strict=True))
        yield Telemetry(1, Batch(stamps, columns, at, 0, 0, 1, stamps[-1]), ClockOffset(0, 1))


def described(boot_id: str = "boot-1") -> Described:
    """The robot that they wear."""
    channels = [
        ChannelInfo(name, unit, name.partition(".")[0], name.partition(".")[2])
        for name, unit in zip(CHANNELS, UNITS, strict=True)
    ]
    return Described(replace(description(ROBOT), boot_id=boot_id, channels=channels))


@functools.cache
def general() -> Learned:
    """Learned from three whose hips swing otherwise than any wearer's in a test."""
    recipe = TASK.named("gait_phase/hips")
    x, truth, who = [], [], []
    for person, habit in enumerate((-0.02, 0.0, 0.02)):
        rows, phase = walk(25.0, habit, person)
        stamps = np.arange(len(rows)) * STEP_MS * MS
        for grid_ns, samples in on_grid(recipe, stamps, rows[:, :2]):
            ends = np.arange(recipe.look_back, len(samples), 4)
            x.append(features(recipe, samples, ends))
            truth.append(phase[grid_ns[ends] // (STEP_MS * MS)])
            who += [person] * len(ends)
    with threadpool_limits(1):
        return learn.learn(TASK, recipe, np.concatenate(x), np.concatenate(truth), np.array(who))


def model(objection: str | None = "unsigned", name: str = "gait_phase-0123456789ab") -> Model:
    """The general model as it serves."""
    made = card(general(), id=name, units=dict(zip(CHANNELS[:2], UNITS, strict=False)))
    return Model(made, general(), objection)
