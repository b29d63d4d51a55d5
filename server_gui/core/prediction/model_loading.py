"""Loading of the serving models: a thread that checks the registry for new ones.

It waits for the store, so that nobody else does. A model that cannot be loaded changes nothing: the one that
serves stays, and `problems` says why.
"""

import logging
import math
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Self

from ml.errors import UnusableModel
from ml.registry.card import Card, check_robot
from ml.registry.pointers import Pointer
from ml.robot.learned import Learned
from ml.robot.task import TASKS
from ml.store import StoreError
from server_gui.core.settings.promoters import objection
from server_gui.core.threads.polling import Polling
from server_gui.core.threads.supervision import Worker

if TYPE_CHECKING:
    from ml.registry.registry import Registry

log = logging.getLogger(__name__)

BREAK_OFF_S: Final = 20.0  # longer than it takes to import what models need, in a window 7 s of a core
RETRY_S: Final = 600.0  # between attempts to load what was refused, while nothing of it has changed

NOBODY: Final[Mapping[str, str]] = MappingProxyType({})

Key = tuple[str, str]  # robot and task


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A model in use; `objection` says why no rule may stop a robot by what it says."""

    card: Card
    learned: Learned
    objection: str | None = None
    learned_from: str = ""  # the wearer whose walk it has learned from, too


class ModelLoader:
    """The models of every robot that `robot` named; use it as a context manager, which ends its thread."""

    def __init__(self, store_url: str, poll_s: float, promoters: Mapping[str, str] = NOBODY) -> None:
        """`promoters` are the fingerprints of those by whose models rules may stop robots, by name."""
        self.models: Mapping[Key, Model] = {}  # replaced as a whole, for any thread
        self.why: Mapping[Key, str] = {}  # no model, or not the newest, serves a robot; likewise
        self.problems: Mapping[Key, str] = {}  # those of `why` that are something wrong
        self.problem: str | None = None  # why nobody knows what serves
        self._url = store_url
        self._promoters = promoters
        self._registry: Registry | None = None
        self._robots: dict[str, dict[str, str]] = {}  # units by channel
        self._loaded: dict[str, tuple[Card, Learned]] = {}
        self._refused: dict[str, str] = {}  # models, and why; until something changes
        self._chosen_for: Mapping[str, dict[str, str]] = {}  # the robots at the newest look
        self._seen: Any = None  # what should serve then, and the files of what was refused
        self._retry_s = math.inf  # when that is tried again, on our monotonic clock
        self._looking = Polling("models", self._look, poll_s, BREAK_OFF_S)

    @property
    def worker(self) -> Worker:
        """Its thread, to be watched over."""
        return self._looking.worker

    def __enter__(self) -> Self:
        self._looking.__enter__()
        return self

    def __exit__(self, *exc: object) -> None:
        self._looking.__exit__(*exc)

    def robot(self, name: str, units: dict[str, str]) -> None:
        """Take a robot's channels, by their units; from any thread."""
        if self._robots.get(name) != units:
            self._robots = self._robots | {name: units}
            self._looking.wake()

    # --- its thread

    def _look(self) -> None:
        if not self._robots:
            return
        try:
            from ml.registry.registry import Registry  # brings scikit-learn, which takes a second or more

            self._registry = self._registry or Registry(self._url)
            self._update(self._registry)
        except Exception as error:  # noqa: BLE001 - whatever a library raises, what serves stays
            self._registry = None
            known = isinstance(error, StoreError | UnusableModel)
            problem = str(error) if known else f"internal error, {type(error).__name__}"  # it may quote keys
            if problem != self.problem:
                log.warning("it is not known which models serve: %s", problem)
            self.problem = problem
        else:
            self.problem = None

    def _update(self, registry: "Registry") -> None:
        robots = self._robots
        served = list(registry.served())
        anew = (served, self._files(registry, served)) != self._seen or time.monotonic() >= self._retry_s
        if anew:
            self._refused = {}
        elif robots == self._chosen_for:
            return
        models, problems, why = dict(self.models), {}, {}
        for robot, units in robots.items():
            for task in TASKS:
                try:
                    if not self._choose(registry, (robot, task), units, models):
                        why[robot, task] = _nobody(task, units)
                except UnusableModel as error:
                    problems[robot, task] = str(error)
                    if self.problems.get((robot, task)) != str(error):
                        log.warning("%s: %s: %s", robot, task, error)
        self.models, self.problems, self.why = models, problems, why | problems
        self._chosen_for, self._seen = robots, (served, self._files(registry, served))
        self._retry_s = time.monotonic() + RETRY_S if problems else math.inf

    def _files(self, registry: "Registry", served: Iterable[tuple[str, str, Pointer]]) -> object:
        """Those of the models that should serve where something is wrong: written anew, they may be right."""
        wrong = {task for _, task in self.problems}
        return {now.model: registry.files(now.model) for task, _, now in served if task in wrong}

    def _choose(
        self, registry: "Registry", key: Key, units: Mapping[str, str], models: dict[Key, Model]
    ) -> bool:
        """Let that model serve which should; False where there is none."""
        robot, task = key
        found = registry.served_to(task, robot, set(units))
        if found is None:
            models.pop(key, None)
            return False
        card, learned = self._load(registry, found.model)
        check_robot(card, robot, units)
        model = Model(card, learned, objection(found.pointer, task, found.robot, card, self._promoters))
        before = models.get(key)
        if before is not None and before.card.id != card.id:
            log.info("%s: %s is served by %s from now on", robot, task, card.id)
        if before is None or (before.learned, before.objection) != (learned, model.objection):
            models[key] = model
        return True

    def _load(self, registry: "Registry", name: str) -> tuple[Card, Learned]:
        """Return a model, loaded once; one that was refused is not asked for again."""
        if name in self._refused:
            raise UnusableModel(self._refused[name])
        if name not in self._loaded:
            try:
                card, state = registry.load(name)
                self._loaded[name] = card, Learned.restored(state)
            except UnusableModel as error:
                self._refused[name] = str(error)
                raise
        return self._loaded[name]


def _nobody(task: str, units: Mapping[str, str]) -> str:
    if TASKS[task].recipe(units.keys()) is None:
        return f"{task} cannot be told from this robot's channels"
    return f"no model serves {task}: gwrms train {task} --promote, or gwrms models promote MODEL"
