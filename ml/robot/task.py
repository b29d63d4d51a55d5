"""The tasks: what a robot's own models predict, what labels mean for it, which sensors it takes."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from functools import partial
from itertools import accumulate, pairwise
from types import MappingProxyType
from typing import Final

import numpy as np

from ml.errors import UnusableModel
from ml.features.recipe import Features, Recipe
from ml.features.windows import Samples
from ml.robot.blocks import BLOCKS, RATE_HZ, Block
from ml.robot.groups import GROUPS, present

UNKNOWN: Final = "unknown"  # what a model says that abstains
ABNORMAL: Final = "abnormal"  # what it says of what is like nothing that it has learned from
STRIDE: Final = "stride"  # the class of gait_phase: the legs step, and both phases are within a tenth
SIDES: Final = ("left", "right")

_Groups = frozenset[str]
Support = tuple[_Groups, ...]  # any one of these sets of groups will do


def _any_of(*names: str) -> Support:
    return tuple(frozenset({name}) for name in names)


@dataclass(frozen=True, slots=True)
class Task:
    """One question to a robot's channels.

    What a model says at a moment is about `delay_ms` before it. `fold` says which class a stored label is;
    a label that is not in it is not learned from. `support` names for each class the groups of sensors that
    it takes to tell it, of which any one set will do. A recipe looks back `look_back` samples.
    """

    name: str
    delay_ms: int
    look_back: int
    fold: Mapping[str, str]
    support: Mapping[str, Support]

    def recipe(self, channels: Set[str]) -> Recipe | None:
        """Return the richest recipe that these channels allow; None where this robot cannot."""
        groups = [group for group in present(channels) if group in BLOCKS[self.name]]
        return self._recipe(groups) if self._classes(groups) else None

    def classes(self, recipe: Recipe) -> tuple[str, ...]:
        """Return the classes that the recipe's sensors can tell.

        Raises:
            UnusableModel: the recipe is none of this task's.

        """
        return self._classes(self._groups(recipe.name))

    def named(self, name: str) -> Recipe:
        """Return the recipe of this name; raises `UnusableModel` where there is none."""
        return self._recipe(self._groups(name))

    def _groups(self, name: str) -> tuple[str, ...]:
        task, _, text = name.partition("/")
        groups = tuple(text.split("+"))
        in_order = tuple(group for group in GROUPS if group in groups and group in BLOCKS[self.name])
        if task != self.name or groups != in_order or not self._classes(groups):
            raise UnusableModel(
                f"{name!r} is no recipe of {self.name}: expected {self.name}/ and groups of sensors in this"
                f" order, joined by +: {', '.join(GROUPS)}, which together tell two classes or a phase"
            )
        return groups

    def _classes(self, groups: Sequence[str]) -> tuple[str, ...]:
        """Those that these groups support; none where nothing can be told from anything."""
        there = frozenset(groups)
        told = tuple(name for name, sets in self.support.items() if any(there >= one for one in sets))
        return told if len(told) >= min(2, len(self.support)) else ()

    def _recipe(self, groups: Sequence[str]) -> Recipe:
        blocks = [(BLOCKS[self.name][group], len(GROUPS[group])) for group in groups]
        return Recipe(
            f"{self.name}/{'+'.join(groups)}",
            RATE_HZ,
            self.look_back,
            tuple(channel for group in groups for channel in GROUPS[group]),
            partial(_compute, blocks),
        )


def _compute(blocks: Sequence[tuple[Block, int]], windows: Samples) -> Features:
    """Every group's block over its own channels, one after the other."""
    bounds = pairwise(accumulate((count for _, count in blocks), initial=0))
    columns = [block(windows[:, slice(*bound)]) for (block, _), bound in zip(blocks, bounds, strict=True)]
    return np.concatenate(columns, axis=1, dtype=np.float32)


_LEGS: Final = _any_of("hips", "knees")
_ANYTHING: Final = _any_of("hips", "knees", "ankles", "feet", "trunk")
_GROUND: Final = (frozenset({"hips", "knees"}), frozenset({"hips", "trunk"}), frozenset({"knees", "trunk"}))

ACTIVITY: Final = Task(
    "activity",
    delay_ms=200,
    look_back=100,
    fold=MappingProxyType(
        {
            "stand": "stand",
            "walk": "walk",
            "sit": "sit",
            "sit_to_stand": "sit_to_stand",
            "stand_to_sit": "stand_to_sit",
            "stairs_up": "stairs_up",
            "stairs_down": "stairs_down",
            "ramp_up": "ramp",
            "ramp_down": "ramp",
            "turn_left": "turn",
            "turn_right": "turn",
        }
    ),
    support=MappingProxyType(
        {
            "stand": _ANYTHING,
            "walk": _ANYTHING,
            "sit": _LEGS,
            "sit_to_stand": _LEGS,
            "stand_to_sit": _LEGS,
            "turn": _any_of("trunk"),
            "stairs_up": _GROUND,
            "stairs_down": _GROUND,
            "ramp": _GROUND,
        }
    ),
)
GAIT_PHASE: Final = Task(
    "gait_phase",
    delay_ms=0,
    look_back=100,
    fold=MappingProxyType({}),  # learned from phases, not from labels
    support=MappingProxyType({STRIDE: _any_of("hips", "knees", "ankles", "feet")}),
)
FALLING_TASK: Final = Task(
    "falling",
    delay_ms=0,
    look_back=75,
    fold=MappingProxyType({**dict.fromkeys(ACTIVITY.fold, "steady"), "stumble": "near_fall", "fall": "fall"}),
    support=MappingProxyType(dict.fromkeys(("steady", "near_fall", "fall"), _any_of("trunk"))),
)
TASKS: Final[Mapping[str, Task]] = MappingProxyType(
    {task.name: task for task in (ACTIVITY, GAIT_PHASE, FALLING_TASK)}
)


def recipe_named(name: str) -> Recipe:
    """Return the recipe of this name, as "activity/hips+knees+trunk".

    Raises `UnusableModel` where there is none.
    """
    task = TASKS.get(name.partition("/")[0])
    if task is None:
        raise UnusableModel(f"{name!r} is no recipe of a robot's own models: those of {', '.join(TASKS)} are")
    return task.named(name)
