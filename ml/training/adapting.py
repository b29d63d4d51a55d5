"""A wearer's own gait phase: a minute of his walking trains the network on; all that comes later judges."""

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ml.errors import UnusableData
from ml.features.recipe import Features
from ml.features.windows import Samples
from ml.robot.learn import BATCH, pointers
from ml.robot.learned import Learned, scaled
from ml.robot.network import FAR
from ml.training.dataset import EVERY_MS, SessionDecisions

MINUTE_S: Final = 60.0  # of steps
LEAST_LATER_S: Final = 20.0  # of steps, to judge by
EPOCHS: Final = 20


@dataclass(frozen=True, slots=True)
class Divided:
    """One wearer's decisions in time's order: those that adapt, and those after them."""

    early: list[SessionDecisions]
    later: list[SessionDecisions]


def divided(parts: Sequence[SessionDecisions], minute_s: float = MINUTE_S) -> Divided:
    """`parts` are in time's order.

    Raises:
        UnusableData: they are of several wearers, or do not step for a minute and some more.

    """
    wearers = sorted({each.group for each in parts if each.named})
    if len(wearers) > 1:
        raise UnusableData(f"{', '.join(wearers)} walk there: name the sessions of one wearer (--session)")
    every_s = EVERY_MS["gait_phase"] / 1e3
    early: list[SessionDecisions] = []
    later: list[SessionDecisions] = []
    stepped_s = 0.0
    for each in parts:
        walked_s = stepped_s + every_s * np.cumsum(~np.isnan(each.truth).any(axis=1))
        early.append(each.of(walked_s <= minute_s))
        later.append(each.of(walked_s > minute_s))
        stepped_s = float(walked_s[-1]) if len(walked_s) else stepped_s
    if stepped_s < minute_s + LEAST_LATER_S:
        raise UnusableData(
            f"there are {stepped_s:.0f} s of steps: {minute_s:g} s adapt a model, and {LEAST_LATER_S:g} s "
            "more judge it (gwrms label SESSION --gait-events finds steps in a recording)"
        )
    return Divided([each for each in early if len(each.truth)], [each for each in later if len(each.truth)])


def adapted(base: Learned, parts: Sequence[SessionDecisions], seed: int = 0) -> Learned:
    """Return a copy that has also learned from these decisions; how far it trusts itself stays as it was."""
    features = np.concatenate([each.features for each in parts])
    return taught(base, features, np.concatenate([each.truth for each in parts]), seed)


def taught(
    base: Learned, features: Features, phases: Samples, seed: int = 0, told: Callable[[], None] = lambda: None
) -> Learned:
    """Return the same, of a row of features and of phases (n, 2) for each decision.

    `told` is called every few milliseconds, so that who learns in a thread can let others work.
    """
    inputs = np.clip(scaled(base.parts["scale"], features), -FAR, FAR)
    targets = pointers(phases)
    network = copy.deepcopy(base.parts["network"])
    random = np.random.default_rng(seed)
    for _ in range(EPOCHS):  # a `partial_fit` warns of nothing, so that any thread may learn
        order = random.permutation(len(inputs))
        for rows in np.split(order, range(BATCH, len(order), BATCH)):
            network.set_params(batch_size=len(rows)).partial_fit(inputs[rows], targets[rows])
            told()
    return replace(base, parts={**base.parts, "network": network})
