"""Training and promotion in a play: the real ones, with a task so small that a handful of rows teaches it.

Scikit-learn comes with this, which takes seconds: it is imported where a play has such a step.
"""

import bisect
import dataclasses
import functools
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence, Set
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from msgspec import json

from ml.errors import Overtaken, UnusableData, UnusableModel
from ml.features.windows import Samples
from ml.registry.card import Card
from ml.registry.pointers import Pointer, Pointers
from ml.registry.registry import Registry
from ml.robot import groups, learn, task
from ml.store import Store, StoreError, upkeep
from ml.store.labels import holding, utc_ns, wearer
from ml.store.objects import Objects
from ml.store.tables import LABELS, TELEMETRY
from ml.training import data_split, dataset, training
from ml.training.dataset import SessionDecisions
from ml.training.training_sessions import Wish
from tests.explore_store.disk import Ended
from tests.explore_store.judging import rows_of_version
from tests.explore_store.ledger import Promoted
from tests.explore_store.robots import ANGLE
from tests.explore_store.server import PEOPLE
from tests.explore_store.times import ours
from tests.explore_store.world import World

TASK: Final = "activity"
NOTHING: Final = Path("/nonexistent")  # no models come with it
OLDEST_NS: Final = 100_000_000  # a value that is older is missing (docs/explanation/prediction.md)
FOLDER: Final = "models/serving"
HELD_OUT: Final = ((), ("P03",))  # two people seldom have the same model
Split = tuple[list[SessionDecisions], list[SessionDecisions], list[SessionDecisions]]
Row = tuple[int, int, float]  # stamp and UTC in ns, angle


def _newest(windows: Samples) -> Samples:
    """The only feature: the value itself, by which a row is known again."""
    return windows[:, :, -1]


_TASKS: Final = task.TASKS
_SMALL: Final = dataclasses.replace(task.ACTIVITY, delay_ms=0, look_back=1)


def prepare(world: World) -> None:
    """Let the knee's angle be enough for a model, and a decision every row."""
    for module in ours():
        for name in [name for name, value in vars(module).items() if value is _TASKS]:
            world.put(module, name, {TASK: _SMALL})
    for of, name, value in _changes(world, {"knees": (ANGLE,)}):
        world.put(of, name, value)
    world.looks.append(look)


def _changes(world: World, known: dict[str, tuple[str, ...]]) -> Iterator[tuple[Any, str, Any]]:
    """What stands for what."""
    yield from ((groups, "GROUPS", known), (groups, "UNITS", {"angle": "rad"}))
    yield from ((task, "GROUPS", known), (task, "BLOCKS", {TASK: {"knees": _newest}}), (task, "RATE_HZ", 100))
    yield from ((learn, "LEAST_ROWS", 1), (learn, "EPOCHS", 1), (learn, "HIDDEN", (2,)))
    yield dataset, "EVERY_MS", {TASK: 10}
    yield from ((data_split, "LEAST_ROWS", 1), (training, "split", functools.partial(_split, world)))
    yield Pointers, "_create", functools.partialmethod(_create, world)


def _split(world: World, parts: Sequence[SessionDecisions], held: Set[str]) -> Split:
    """What is learned from and judged by is looked at in passing."""
    found = data_split.split(parts, held)
    world.classes.split = found
    return found


_really_create: Final = Pointers._create


def _create(self: Pointers, world: World, pointer: Pointer) -> Pointer | None:
    """Just before somebody's pointer is written, somebody else may be faster."""
    meanwhile, world.classes.meanwhile = world.classes.meanwhile, None
    if meanwhile is not None:
        meanwhile()
    done = _really_create(self, pointer)
    if done is not None:
        world.classes.written.append((self._path(pointer.number), pointer.who, pointer.model))
    return done


# --- training


def train(world: World, who: int) -> None:
    """Train on what is there now, and publish; whoever fails has changed nothing that serves."""
    before, faults = serving(world), world.faults
    registry, split = Registry(world.url, NOTHING), None
    try:
        trained = training.train(registry, Wish(TASK, held_out=HELD_OUT[who]))
        split = world.classes.split
        model = registry.publish(trained.learned.state(), trained.card)
    except UnusableModel as error:
        world.check(False, "a model that serves or was published cannot be used", error)
    except (StoreError, OSError) as error:
        world.check(world.explains(str(error), faults), "a training fails without cause", error)
    except (UnusableData, Ended):
        pass
    else:
        world.classes.trained[who] = (model, trained.over)
        world.classes.published.add(model)
        store = Store.existing(world.url)
        for each in trained.card.tables:
            rows = rows_of_version(store, each.location, each.version)
            world.pinned.append((each.location, each.version, rows))
    if world.disk.left is None:
        world.check(serving(world) == before, "a training has changed what serves", before)
    if split is not None:
        _look_at_lessons(world, trained.card, split)


def _look_at_lessons(world: World, card: Card, split: Split) -> None:
    """Exactly the labelled rows of the versions that the card names, each wearer on one side."""
    store = Store.existing(world.url)
    versions = {each.location: each.version for each in card.tables}
    rows, labels = _rows(store, versions), _labels(store, versions)
    lessons, judges, _ = split
    for part in (*lessons, *judges):
        whose = (part.ask.robot, part.ask.session)
        _look_at_part(world, part, rows[whose], labels[whose])
    there = {(each.ask.robot, each.ask.session) for each in (*lessons, *judges)}
    for whose, said in labels.items():
        if (
            len(rows[whose]) > 2
            and len(_people(said)) == 1
            and _activities(said)
            and _in_rad(world, rows[whose])
        ):
            world.check(whose in there, "a labelled session is neither learned from nor judged by", whose)
    sides = [{who for part in side for who in _people(labels[part.ask.robot, part.ask.session])}
             for side in (lessons, judges)]  # fmt: skip
    world.check(not sides[0] & sides[1], "a wearer is on both sides of what is held out", *sides)


def _look_at_part(world: World, part: SessionDecisions, rows: list[Row], said: list[dict[str, Any]]) -> None:
    known = {row.number: row for row in world.ledger.rows()}
    stamps = [stamp for stamp, _, _ in rows]
    in_order = [utc for _, utc, _ in rows] == sorted(utc for _, utc, _ in rows)
    taught = set()
    for at_ns, (value,), truth in zip(
        part.stamps_ns.tolist(), part.features.tolist(), part.truth.tolist(), strict=True
    ):
        at = bisect.bisect_right(stamps, at_ns) - 1
        world.check(
            at >= 0 and at_ns - stamps[at] <= OLDEST_NS, "a model learns from a row that is not there", value
        )
        world.check(rows[at][2] == value, "a model learns another value than the row has", value, rows[at])
        row = known[int(value)]
        world.check(
            (row.robot, row.session) == (part.ask.robot, part.ask.session),
            "a model learns from another's row",
            row,
        )
        world.check(row.unit != "deg", "a model learns degrees as radians", row)
        near = {_activity(said, utc) for _, utc, _ in rows[at : at + 2]}
        world.check(
            not in_order or truth in near, "a model learns another label than was given", truth, near, row
        )
        taught.add(value)
    lacks = [value for _, utc, value in rows[:-1] if value not in taught and _activity(said, utc)]
    world.check(not in_order or not lacks, "labelled rows are not learned from", lacks)


def _rows(store: Store, versions: dict[str, int]) -> dict[tuple[str, str], list[Row]]:
    """Those with an angle in rad, in the order of the robot's clock."""
    found: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for location, version in versions.items():
        if location.startswith(TELEMETRY.name):
            for line in store.dataset(location, version).to_table().to_pylist():
                if line.get(ANGLE) is not None:
                    row = (line["stamp_ns"], utc_ns(line["utc"]), line[ANGLE])
                    found[line["robot"], line["session"]].append(row)
    for some in found.values():
        some.sort()
    return found


def _labels(store: Store, versions: dict[str, int]) -> dict[tuple[str, str], list[dict[str, Any]]]:
    found: dict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
    for row in holding(store.dataset(LABELS.name, versions[LABELS.name]).to_table().to_pylist()):
        found[row["robot"], row["session"]].append(row)
    return found


def _people(said: list[dict[str, Any]]) -> set[str]:
    return {PEOPLE[name] for row in said if (name := wearer(row["label"]))}


def _activities(said: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [row for row in said if row["label"] in task.ACTIVITY.fold and row["utc"] < row["ended"]]


def _activity(said: list[dict[str, Any]], at_ns: int) -> str:
    """What all agree on that he did then."""
    found = {row["label"] for row in _activities(said) if _within(row["utc"], row["ended"], at_ns)}
    return found.pop() if len(found) == 1 else ""


def _within(begin: datetime, end: datetime, at_ns: int) -> bool:
    return utc_ns(begin) <= at_ns < utc_ns(end)


def _in_rad(world: World, rows: list[Row]) -> bool:
    numbers = {int(value) for _, _, value in rows}
    return all(row.unit == "rad" for row in world.ledger.rows() if row.number in numbers)


# --- promotion


def promote(world: World, who: int, robot: str, meanwhile: Callable[[], None] | None = None) -> None:
    """Let the model that somebody has trained serve in the place of that which it was judged against."""
    if who not in world.classes.trained:
        return
    (model, over), name, faults = world.classes.trained[who], f"person {who}", world.faults
    before, world.classes.written = serving(world), []
    world.classes.meanwhile = meanwhile
    try:
        Registry(world.url, NOTHING).promote(model, robot, who=name, why="better", over=over)
    except Overtaken:
        others = _after(before, [each for each in world.classes.written if each[1] != name])
        now = serving(world)
        world.check(
            _whom(now, robot) == _whom(others, robot),
            "a promotion that was refused has changed what serves",
            now,
        )
    except UnusableModel as error:
        world.check(False, "a model that was published cannot be promoted", error)
    except (StoreError, OSError) as error:
        world.check(world.explains(str(error), faults), "a promotion fails without cause", error)
    except Ended:
        pass
    else:
        _look_at_promotion(world, Promoted(robot, model, over), before, name)
    finally:
        world.classes.meanwhile = None


def _look_at_promotion(world: World, done: Promoted, before: dict[str, str], name: str) -> None:
    """Just before its pointer was written that served which it was judged against."""
    written = world.classes.written
    place = next((at for at, each in enumerate(written) if each[1:] == (name, done.model)), None)
    served = _after(before, written if place is None else written[:place])
    if place is None:
        world.check(served.get(done.robot) == done.model, "a promotion has done nothing", done)
        return
    world.check(_whom(served, done.robot) == done.over,
          "a model serves over another than it was judged against", done, served)  # fmt: skip
    world.classes.promoted[written[place][0]] = done


def _after(before: dict[str, str], written: Sequence[tuple[str, str, str]]) -> dict[str, str]:
    return before | {_robot(path): model for path, _, model in written}


def _whom(found: dict[str, str], robot: str) -> str:
    """The model that serves the robot."""
    return found.get(robot) or found.get("") or ""


def _robot(path: str) -> str:
    name = path.split("/")[-2]
    return "" if name == "_all" else name


def serving(world: World) -> dict[str, str]:
    """By robot ("" for all) what its newest pointer says; read as the files are."""
    return {_robot(path): model for path, model in _pointers(world)}


def _pointers(world: World) -> Iterator[tuple[str, str]]:
    with world.disk.unseen():
        objects = Objects(world.url)
        for path in objects.names(FOLDER):
            try:
                yield path, json.decode(objects.read(path) or b"", type=Pointer).model
            except ValueError as error:
                world.check(False, "what says which model serves is damaged", path, error)


# --- at the end


def look(world: World, store: Store) -> None:
    """What was published is whole, what was promoted is in the history, and what serves is one of these."""
    registry = Registry(world.url, NOTHING)
    served = dict(_pointers(world))
    for model in {*world.classes.published, *filter(None, served.values())}:
        try:
            registry.load(model)
        except UnusableModel as error:
            world.check(False, "a model is not whole", error)
    world.check(
        set(filter(None, served.values())) <= world.classes.published,
        "what serves was never published",
        served,
    )
    for path, done in world.classes.promoted.items():
        world.check(served.get(path) == done.model, "a promotion is not in the history", path, done)
    world.check(not registry.damaged(), "models are damaged", registry.damaged())
    pinned = {(pin.location, pin.version, pin.by) for pin in upkeep.pins(store)}
    for model in world.classes.published:
        wanted = {(each.location, each.version, model) for each in registry.card(model).tables}
        world.check(wanted <= pinned, "a published model's data is not pinned", wanted - pinned)
