"""Training: what a store's sessions and labels say → a model, its card, and whether it may serve.

Nothing is published here. The same tables and the same wish give the same model, bit by bit.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Final

import numpy as np
from msgspec.structs import replace
from threadpoolctl import threadpool_limits

from ml.errors import UnusableData, UnusableModel
from ml.features.recipe import Recipe
from ml.progress import Tell, untold
from ml.registry.card import Card, DataSource, Metrics
from ml.registry.code import features_hash
from ml.registry.code import versions as library_versions
from ml.registry.registry import Registry
from ml.robot.groups import unit
from ml.robot.learn import learn
from ml.robot.learned import Learned
from ml.robot.task import Task
from ml.store.labels import LabelSource
from ml.training.adapting import adapted, divided
from ml.training.data_split import held_out, judging, recipe_for, split, too_few
from ml.training.dataset import LeftOut, SessionDecisions
from ml.training.judging import Decision, Judged, decide, judge
from ml.training.training_sessions import Material, Wish, material

SEED: Final = 0


@dataclass(frozen=True, slots=True)
class Trained:
    """A model, how it was judged, and what it learned from."""

    learned: Learned
    card: Card
    serving: str  # the model that it was compared with; "" where nothing serves
    over: str  # what served then, which it may take the place of; "" for nothing
    held_out: Judged
    regression: Judged | None
    decision: Decision
    left_out: tuple[LeftOut, ...]
    remarks: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Model:
    """A published one."""

    name: str
    card: Card
    learned: Learned


def train(registry: Registry, wish: Wish, cluster: str = "", tell: Tell = untold) -> Trained:
    """Learn what is wished for from the registry's store, and judge it against what serves.

    `tell` hears how far it is.

    Raises:
        UnusableData: nothing can be learned; says what is missing.
        UnusableModel: the serving model, or the one to adapt, cannot be used.
        StoreError: the store cannot be read.

    """
    teach = _personal if wish.adapt_from else _general
    with threadpool_limits(1):  # the same bits on every computer; and networks as small as these learn faster
        return teach(registry, material(registry.url, wish, cluster, tell), wish)


def _general(registry: Registry, found: Material, wish: Wish) -> Trained:
    recipe = recipe_for(found.task, found.channels())
    serving = _serving(registry, found.task, wish.robot, recipe)
    parts, left_out = found.parts(recipe, *_teacher(wish, serving))
    if not parts:
        raise UnusableData("no session can be learned from; " + "; ".join(map(told, left_out)))
    labelled = [
        each for each in parts if not each.regression and (each.source != LabelSource.PSEUDO.value).any()
    ]
    able = judging(labelled)
    held = held_out((each.group for each in able), wish.held_out, len(labelled) - len(able))
    lessons, judges, regression = split(parts, held)
    lessons, remarks = _enough(found.task, lessons)
    remarks += _unnamed(len(labelled) - len(able))
    if not lessons:
        raise UnusableData(f"nothing is left to learn from; {'; '.join(remarks)}")
    learned = learn(
        found.task,
        recipe,
        np.concatenate([each.features for each in lessons]),
        np.concatenate([each.truth for each in lessons]),
        np.concatenate([np.full(len(each.truth), each.group) for each in lessons]),
        SEED,
        found.told,
    )
    found.told("judging", 0, 1)
    other = None if serving is None else serving.learned
    its = _its_parts(found, serving, recipe, [*judges, *regression])
    people = judge("held-out people", learned, judges, other, its)
    fixed = judge("regression set", learned, regression, other, its)
    if not regression:
        remarks.append("there is no regression set to judge by (gwrms label SESSION --regression)")
    card = _card(found, learned, lessons, [*judges, *regression], people.new)
    lacking = () if serving is not None else _lacking(registry, found.task, recipe)
    return _trained(learned, card, serving, serving, people, fixed, left_out, remarks, lacking)


def _personal(registry: Registry, found: Material, wish: Wish) -> Trained:
    if not wish.robot:
        raise UnusableData("a model is adapted to the wearer of one robot: name it with --robot")
    if found.task.fold:
        raise UnusableData(f"{found.task.name} is not adapted to a wearer; gait_phase is")
    base = _loaded(registry, wish.adapt_from)
    if base.learned.task is not found.task:
        raise UnusableModel(f"{base.name} is a model of {base.learned.task.name}, not of {found.task.name}")
    parts, left_out = found.parts(base.learned.recipe)
    walk = divided([each for each in parts if not each.regression])
    found.told("learning", 0, 1)
    learned = adapted(base.learned, walk.early, SEED)
    found.told("judging", 0, 1)
    serves = _serving(registry, found.task, wish.robot, base.learned.recipe)
    serving = serves or base
    its = _its_parts(found, serving, base.learned.recipe, walk.later)
    later = judge("later walking", learned, walk.later, serving.learned, its)
    old, new = (judge("alone", each, walk.later, None, ()).new for each in (base.learned, learned))
    card = _card(found, learned, walk.early, walk.later, later.new)
    card = replace(card, robot=wish.robot, parent=base.name, source=_both(card.source, base.card.source))
    nothing = Judged("regression set", 0, Metrics(), None)
    return _trained(learned, card, serving, serves, later, nothing, left_out, [_cut(old, new)])


def told(left_out: LeftOut) -> str:
    """Return why a session is left out, for people."""
    return f"{left_out.ask.session} of {left_out.ask.robot}: {left_out.why}"


def _cut(old: Metrics, new: Metrics) -> str:
    before, after = (metrics.figures["rmse_percent"] for metrics in (old, new))
    return (
        f"adapting cuts the error of the later walking by {100.0 * (1.0 - after / before):.0f} %: "
        f"from {before:.2f} to {after:.2f} % of the cycle"
    )


# --- models


def _loaded(registry: Registry, name: str) -> _Model:
    card, state = registry.load(name)
    return _Model(name, card, Learned.restored(state))


def _serving(registry: Registry, task: Task, robot: str, recipe: Recipe) -> _Model | None:
    """Return the model that serves robots with these sensors."""
    name = registry.serving(task.name, robot, set(recipe.channels))
    return None if name is None else _loaded(registry, name)


def _lacking(registry: Registry, task: Task, recipe: Recipe) -> Sequence[str]:
    """Return which channels the fullest model that comes with GWRMS has, and these sessions do not."""
    shipped = registry.shipped()
    known = [card for card in registry.entries(task.name) if card.id in shipped]
    fullest = max(known, key=lambda card: (len(card.channels), card.made), default=None)
    return () if fullest is None else sorted(set(fullest.channels) - set(recipe.channels))


def _teacher(wish: Wish, serving: _Model | None) -> tuple[str, float]:
    if wish.pseudo is None:
        return "", 1.0
    if not serving or not serving.learned.task.fold:
        raise UnusableData(f"there are no pseudo-labels for {wish.task}: no model serves that gives any")
    return serving.name, wish.pseudo


def _its_parts(
    found: Material, serving: _Model | None, recipe: Recipe, judges: Sequence[SessionDecisions]
) -> Sequence[SessionDecisions]:
    """Return the same sessions with the features of the serving model."""
    if serving is None or serving.learned.recipe.name == recipe.name:
        return judges
    return found.of(judges).parts(serving.learned.recipe)[0]


# --- examples


def _enough(task: Task, lessons: Sequence[SessionDecisions]) -> tuple[list[SessionDecisions], list[str]]:
    """Lessons of classes with examples enough, and what is left out."""
    if not task.fold or not lessons:
        return list(lessons), []
    counts = Counter(np.concatenate([each.truth for each in lessons]).tolist())
    rare = too_few(counts)
    kept = [each.of(~np.isin(each.truth, list(rare))) for each in lessons]
    return [each for each in kept if len(each.truth)], list(rare.values())


def _unnamed(sessions: int) -> list[str]:
    """Return a remark on unnamed sessions, whose wearer may be among those who judge."""
    if not sessions:
        return []
    remark = (
        f"sessions without a wearer's name, beside others with one: {sessions}; they are left out of "
        "judging, and may have taught the model somebody who judges it: say whose they are "
        "(gwrms label SESSION --wearer NAME)"
    )
    return [remark]


def _rows(lessons: Sequence[SessionDecisions]) -> Mapping[str, int]:
    """Return the number of labelled rows by source."""
    return Counter(np.concatenate([each.source for each in lessons]).tolist())


# --- the card


def _card(
    found: Material,
    learned: Learned,
    lessons: Sequence[SessionDecisions],
    judges: Sequence[SessionDecisions],
    metrics: Metrics,
) -> Card:
    recipe, rows = learned.recipe, _rows(lessons)
    lows, highs = (
        extreme(np.stack([each.ranges[:, at] for each in lessons]), axis=0)
        for at, extreme in enumerate((np.min, np.max))
    )
    return Card(
        task=learned.task.name,
        recipe=recipe.name,
        classes=learned.classes,
        channels=recipe.channels,
        units={name: unit(name) for name in recipe.channels},
        ranges={
            name: (float(low), float(high))
            for name, low, high in zip(recipe.channels, lows, highs, strict=True)
        },
        features_hash=features_hash(recipe),
        source=_origin(rows),
        seed=SEED,
        made=datetime.now(UTC),
        versions=library_versions(),
        tables=found.tables(),
        learned=_sessions(lessons),
        held_out=_sessions(judges),
        metrics=_of_its_classes(metrics, learned.classes),
        notes="learned from decisions labelled by: "
        + ", ".join(f"{source} {count}" for source, count in sorted(rows.items())),
    )


def _sessions(parts: Sequence[SessionDecisions]) -> tuple[str, ...]:
    return tuple(sorted({each.ask.session for each in parts}))


def _origin(rows: Mapping[str, int]) -> DataSource:
    simulated = rows.get(LabelSource.SIMULATOR.value, 0)
    if not simulated:
        return DataSource.RECORDED
    return DataSource.SIMULATED if simulated == sum(rows.values()) else DataSource.MIXED


def _both(one: DataSource, other: DataSource) -> DataSource:
    return one if one is other else DataSource.MIXED


def _of_its_classes(metrics: Metrics, classes: Sequence[str]) -> Metrics:
    """Without the rows and columns of classes that it does not know, but somebody else does."""
    own = len(classes)
    confusion = tuple((*row[:own], row[-1]) for row in metrics.confusion[:own])
    return replace(metrics, confusion=confusion)


def _trained(
    learned: Learned,
    card: Card,
    serving: _Model | None,
    over: _Model | None,
    people: Judged,
    fixed: Judged,
    left_out: Sequence[LeftOut],
    remarks: Sequence[str],
    lacking: Sequence[str] = (),
) -> Trained:
    known = set(() if serving is None else serving.card.learned) & set(card.held_out)
    if known:
        remarks = [
            *remarks,
            f"the serving model has learned from {', '.join(sorted(known))}: that flatters it",
        ]
    regression = fixed if fixed.decisions else None
    return Trained(
        learned,
        card,
        "" if serving is None else serving.name,
        "" if over is None else over.name,
        people,
        regression,
        decide(learned.task, people, regression, lacking),
        tuple(left_out),
        tuple(remarks),
    )
