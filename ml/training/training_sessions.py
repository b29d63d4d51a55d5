"""The sessions that a model is to learn from or to be judged by, at fixed versions of their tables."""

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace

from msgspec import Struct

from ml.errors import UnusableData
from ml.features.recipe import Recipe
from ml.progress import Tell, untold
from ml.registry.card import TableVersion
from ml.robot.task import TASKS, Task
from ml.store import Store
from ml.store import sessions as stored
from ml.store.labels import holding
from ml.store.sessions import Session, among
from ml.store.tables import LABELS, SESSIONS, TELEMETRY
from ml.store.translation import translated
from ml.training.dataset import Ask, LeftOut, SessionDecisions, versions
from ml.training.extract import extract


class Wish(Struct, frozen=True):
    """The requested training.

    `sessions` are names, or how these alone begin; none: all with labels. `held_out` are wearers or
    sessions. `pseudo` is the probability from which on the serving model's own word is learned from.
    `adapt_from` is a model that a robot's wearer teaches his gait.
    """

    task: str
    robot: str = ""
    sessions: tuple[str, ...] = ()
    held_out: tuple[str, ...] = ()
    pseudo: float | None = None
    adapt_from: str = ""


@dataclass(frozen=True, slots=True)
class Material:
    """The sessions of a wish. `cluster` is the address of a Dask scheduler that reads them, if any.

    `told` hears how far the reading is.
    """

    task: Task
    store: Store
    sessions: list[Session]  # in time's order
    versions: dict[str, int]
    cluster: str = ""
    told: Tell = untold

    def parts(
        self, recipe: Recipe, teacher: str = "", least: float = 1.0
    ) -> tuple[list[SessionDecisions], list[LeftOut]]:
        """Return every session's decisions with a recipe's features, and the sessions without any."""
        asks = [
            Ask(self.store.url, self.versions, each.robot, each.session, recipe.name, teacher, least)
            for each in self.sessions
        ]
        found = extract(asks, self.cluster, self.told)
        parts = [each for each in found if isinstance(each, SessionDecisions)]
        return parts, [each for each in found if isinstance(each, LeftOut)]

    def of(self, parts: Sequence[SessionDecisions]) -> "Material":
        """Return the sessions of these parts alone."""
        wanted = {(each.ask.robot, each.ask.session) for each in parts}
        chosen = [each for each in self.sessions if (each.robot, each.session) in wanted]
        return replace(self, sessions=chosen)

    def channels(self) -> list[Set[str]]:
        """Return each session's channels: those described by the robot, or else those with values."""
        return [
            set(each.units) or {channel.name for channel in stored.channels(self.store, each)}
            for each in self.sessions
        ]

    def tables(self) -> tuple[TableVersion, ...]:
        """Return the permanent versions of the tables behind a model."""
        shards = self.store.about.shards
        wanted = {LABELS.name, SESSIONS.name}
        wanted |= {TELEMETRY.location(each.robot, shards) for each in self.sessions}
        return tuple(
            TableVersion(self.store.url, location, version)
            for location, version in self.versions.items()
            if location in wanted
        )


def material(url: str, wish: Wish, cluster: str = "", told: Tell = untold) -> Material:
    """Return the store's data for a wish, at its present versions.

    Raises:
        UnusableData: nothing.
        StoreError: the store cannot be read, or a session is not there.

    """
    store = Store.existing(url)
    known = [each for each in stored.sessions(store, wish.robot or None) if each.rows]
    pinned = versions(store, sorted({each.robot for each in known}))
    if wish.sessions:
        wanted = {id(among(known, name, url)) for name in wish.sessions}
        chosen = [each for each in known if id(each) in wanted]
    elif wish.pseudo is not None:
        chosen = known
    else:
        labelled = _labelled(store, pinned)
        chosen = [each for each in known if (each.robot, each.session) in labelled]
    if not chosen:
        whose = f"of {wish.robot} " if wish.robot else ""
        raise UnusableData(f"no session {whose}in {url} has labels: give some (gwrms label --help)")
    return Material(TASKS[wish.task], store, chosen, pinned, cluster, told)


def _labelled(store: Store, pinned: dict[str, int]) -> set[tuple[str, str]]:
    """Robots and sessions."""
    if LABELS.name not in pinned:
        return set()
    with translated(f"{store.url}/{LABELS.name} cannot be read"):
        rows = store.dataset(LABELS.name, pinned[LABELS.name]).to_table().to_pylist()
    return {(row["robot"], row["session"]) for row in holding(rows)}
