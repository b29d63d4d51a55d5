"""Every model of a store: whom it serves, what it would take the place of, how right it was last week."""

import re
from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from typing import Final, Self
from urllib.parse import urlsplit

from gateway.amounts import NONE
from ml.errors import UnusableModel
from ml.registry.card import Card
from ml.registry.pointers import Pointer
from ml.registry.registry import Registry
from ml.store import StoreError
from ml.store.url import checked_url
from server_gui.core.models.names import EVERY, model_names
from server_gui.core.prediction.state import Quality
from server_gui.core.prediction.track_record import TrackRecord
from server_gui.core.settings.promoters import UNSIGNED, desk_signature, signer

KEY: Final = re.compile(r"\b[0-9a-f]{64}\b")  # a fingerprint
BY_DEFAULT: Final = "by default"  # where no other was promoted
SHORT: Final = 16  # of its signs, as people compare it


@dataclass(frozen=True, slots=True)
class Serving:
    """Robots by promoted model, the signers of the promotions, and the shipped models."""

    whom: Mapping[str, list[str]]
    shipped: frozenset[str]
    signed: Mapping[str, list[str]]

    @classmethod
    def of(cls, registry: Registry, promoters: Mapping[str, str] = MappingProxyType({})) -> Self:
        whom: dict[str, list[str]] = {}
        signed: dict[str, list[str]] = {}
        for task, robot, now in registry.served():
            whom.setdefault(now.model, []).append(robot or EVERY)
            signed.setdefault(now.model, []).append(_signer(registry, task, robot, now, promoters))
        return cls(whom, registry.shipped(), signed)

    def told(self, model: str) -> str:
        """Return the robots that a model serves, each with the signer of its promotion."""
        whom, signed = self.whom.get(model, []), self.signed.get(model, [])
        pairs = [*zip(whom, signed, strict=True)]
        if model in self.shipped and EVERY not in whom:
            pairs.append((BY_DEFAULT, UNSIGNED))
        return ", ".join(f"{served} ({by})" for served, by in pairs)


def _signer(registry: Registry, task: str, robot: str, now: Pointer, promoters: Mapping[str, str]) -> str:
    """Return a signature that does not hold is none."""
    try:
        return signer(now, task, robot, registry.card(now.model), promoters)
    except UnusableModel:
        return UNSIGNED


@dataclass(frozen=True, slots=True)
class Entry:
    """A model; `serving` is the id of what serves in its place now, which may be itself, or ""."""

    card: Card
    name: str
    shipped: bool
    serves: tuple[str, ...]
    serving: str
    hits: Mapping[str, Quality] = field(default_factory=dict)  # by robot, within the last week
    signed: tuple[str, ...] = ()  # who has signed that it serves, for each of `serves`

    @property
    def whom(self) -> str:
        """Return the robots that it serves, in words."""
        default = (BY_DEFAULT,) if self.shipped and EVERY not in self.serves else ()
        return ", ".join((*self.serves, *default)) or "nobody"

    @property
    def signature(self) -> str:
        """Return by whom its promotion is signed, in words; what nobody has promoted, nobody has signed."""
        if not self.serves:
            return UNSIGNED if self.shipped else NONE
        said = [KEY.sub(lambda key: f"{key[0][:SHORT]}…", one) for one in self.signed]
        if len(set(said)) == 1:
            return said[0]
        return "; ".join(f"{whom}: {one}" for whom, one in zip(self.serves, said, strict=True))


@dataclass(frozen=True, slots=True)
class Catalogue:
    """Models, newest first; `problem` is the reason if some or all are missing."""

    entries: tuple[Entry, ...] = ()
    damaged: tuple[str, ...] = ()
    problem: str = ""
    hits_problem: str = ""  # why nothing is known of the last week

    def find(self, model: str) -> Entry | None:
        """Return a model by its id."""
        return next((entry for entry in self.entries if entry.card.id == model), None)


Hits = Mapping[str, Mapping[str, Quality]]  # by model and robot


def open_registry(url: str, *, given: bool = True) -> Registry:
    """Return the registry at a store's URL; where it is `given` by somebody, it must be there.

    Raises:
        StoreError: the URL is none, or there is no such folder.

    """
    place = checked_url(url)
    if given and not _is_there(place):
        raise StoreError(f"there is no store at {place}")
    return Registry(place, sign=desk_signature())


def _is_there(place: str) -> bool:
    """Return whether the folder of a store is there; any other is asked by what reads it."""
    return not place.startswith("file://") or Path(urlsplit(place).path).is_dir()


def why_it_cannot_serve(registry: Registry, model: str) -> str:
    """Return why a model cannot serve here; nothing where it can."""
    try:
        registry.load(model)
    except UnusableModel as error:
        return str(error)
    return ""


class Looking:
    """Looks into one store again and again; for one thread."""

    def __init__(self, url: str, promoters: Mapping[str, str] = MappingProxyType({})) -> None:
        """`promoters` are the fingerprints of keys by whose they are."""
        self._url = url
        self._promoters = promoters
        self._record: TrackRecord | None = None
        self._was_there = False  # a store that was there once is no new one when it is gone

    def look(self, robots: Set[str], ending: Callable[[], bool] = lambda: False) -> Catalogue:
        """Return the present catalogue; blocks. Errors are entered in it as problems."""
        try:
            registry = open_registry(self._url, given=self._was_there)
            self._was_there = _is_there(checked_url(self._url))
            hits, hits_problem = self._hits(robots, ending)
            entries = tuple(reversed(list(_entries(registry, hits, self._promoters))))
            return Catalogue(entries, tuple(registry.damaged().values()), "", hits_problem)
        except (StoreError, UnusableModel, OSError) as error:
            return Catalogue(problem=str(error))

    def _hits(self, robots: Set[str], ending: Callable[[], bool]) -> tuple[Hits, str]:
        try:
            if self._record is None:
                self._record = TrackRecord(self._url)
            figures = self._record.figures(robots, datetime.now(UTC), ending)
        except (StoreError, OSError) as error:
            self._record = None
            return {}, str(error)
        found: dict[str, dict[str, Quality]] = {}
        for robot, tasks in figures.items():
            for models in tasks.values():
                for model, quality in models.items():
                    found.setdefault(model, {})[robot] = quality
        return found, ""


def _entries(registry: Registry, hits: Hits, promoters: Mapping[str, str]) -> Iterator[Entry]:
    cards, serving = registry.entries(), Serving.of(registry, promoters)
    names = model_names(cards, serving.shipped)
    for card in cards:
        yield Entry(
            card,
            names[card.id],
            card.id in serving.shipped,
            tuple(serving.whom.get(card.id, ())),
            _in_its_place(registry, card),
            hits.get(card.id, {}),
            tuple(serving.signed.get(card.id, ())),
        )


def _in_its_place(registry: Registry, card: Card) -> str:
    try:
        return registry.serving(card.task, card.robot, set(card.channels)) or ""
    except UnusableModel:
        return ""  # what should serve is damaged, which the list says
