"""Which models serve: a thread that looks into the registry again and again, and loads what is new there.

It waits for the store, so that nobody else does. A model that cannot be loaded changes nothing: the one that
serves stays, and `problems` says why.
"""

import logging
import math
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Self

from ml.errors import UnusableModel
from ml.registry.card import Card, check_robot
from ml.robot.learned import Learned
from ml.robot.task import TASKS
from ml.store import StoreError
from server_gui.core.threads.polling import Looking
from server_gui.core.threads.supervision import Worker

if TYPE_CHECKING:
    from ml.registry.registry import Registry

log = logging.getLogger(__name__)

BREAK_OFF_S: Final = 20.0  # longer than it takes to import what models need, in a window 7 s of a core
RETRY_S: Final = 600.0  # between attempts to load what was refused, while nothing of it has changed

Key = tuple[str, str]  # robot and task


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A model in use."""

    card: Card
    learned: Learned


class Serving:
    """The models of every robot that `robot` named; use it as a context manager, which ends its thread."""

    def __init__(self, store_url: str, poll_s: float) -> None:
        self.models: Mapping[Key, Model] = {}  # replaced as a whole, for any thread
        self.why: Mapping[Key, str] = {}  # no model, or not the newest, serves a robot; likewise
        self.problems: Mapping[Key, str] = {}  # those of `why` that are something wrong
        self.problem: str | None = None  # why nobody knows what serves
        self._url = store_url
        self._registry: Registry | None = None
        self._robots: dict[str, dict[str, str]] = {}  # units by channel
        self._loaded: dict[str, Model] = {}
        self._refused: dict[str, str] = {}  # models, and why; until something changes
        self._chosen_for: Mapping[str, dict[str, str]] = {}  # the robots at the newest look
        self._seen: Any = None  # what should serve then, and the files of what was refused
        self._retry_s = math.inf  # when that is tried again, on our monotonic clock
        self._looking = Looking("models", self._look, poll_s, BREAK_OFF_S)

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
        """A robot has these channels, by their units; from any thread."""
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
        served = [(task, robot, pointer.model) for task, robot, pointer in registry.served()]
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

    def _files(self, registry: "Registry", served: Iterable[tuple[str, str, str]]) -> object:
        """Those of the models that should serve where something is wrong: written anew, they may be right."""
        wrong = {task for _, task in self.problems}
        return {model: registry.files(model) for task, _, model in served if task in wrong}

    def _choose(
        self, registry: "Registry", key: Key, units: Mapping[str, str], models: dict[Key, Model]
    ) -> bool:
        """Let that model serve which should; False where there is none."""
        robot, task = key
        found = registry.serving(task, robot, set(units))
        if found is None:
            models.pop(key, None)
            return False
        model = self._load(registry, found)
        if key in models and models[key].card.id != found:
            log.info("%s: %s is served by %s from now on", robot, task, found)
        check_robot(model.card, robot, units)
        models[key] = model
        return True

    def _load(self, registry: "Registry", name: str) -> Model:
        """A model, loaded once; one that was refused is not asked for again."""
        if name in self._refused:
            raise UnusableModel(self._refused[name])
        if name not in self._loaded:
            try:
                card, state = registry.load(name)
                self._loaded[name] = Model(card, Learned.restored(state))
            except UnusableModel as error:
                self._refused[name] = str(error)
                raise
        return self._loaded[name]


def _nobody(task: str, units: Mapping[str, str]) -> str:
    if TASKS[task].recipe(units.keys()) is None:
        return f"{task} cannot be told from this robot's channels"
    return f"no model serves {task}: gwrms train {task} --promote, or gwrms models promote MODEL"
