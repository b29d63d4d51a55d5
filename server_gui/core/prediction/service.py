"""A thread that predicts the status of every robot, of all together; nobody ever waits for it."""

import collections
import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Final, Self, TypeVar

from threadpoolctl import threadpool_limits

from ml.danger.calibration import Calibration, load
from ml.errors import UnusableModel
from ml.robot.task import TASKS
from ml.serving.predictor import judged
from server_gui.core.follow.events import Event
from server_gui.core.prediction.adaptation import GAIT_PHASE, Happening, Wearing
from server_gui.core.prediction.adapting import AdaptingService
from server_gui.core.prediction.inbox import Inbox
from server_gui.core.prediction.model_loading import Model, ModelLoader
from server_gui.core.prediction.news import Predicted, PredictionNews, Ruled
from server_gui.core.prediction.robot_predictor import RobotPredictor, Watched
from server_gui.core.prediction.state import PredictingState, TaskReport
from server_gui.core.prediction.track_record_updates import TrackRecordUpdates
from server_gui.core.settings.prediction import Action, RuleSettings
from server_gui.core.settings.server_file import ServerSettings
from server_gui.core.threads.supervision import BEAT_S, Worker

log = logging.getLogger(__name__)

Thing = TypeVar("Thing")

STILL_S: Final = 1.0  # what is due of one model, and the rows of all robots, take less
BROKEN: Final = "it cannot be used: internal error, "
BARRED: Final = "a rule stops this robot by its gait phase, which an unproven model may not judge"


class PredictionService:
    """Predicts from entering to leaving; use it as a context manager, which joins its threads.

    `take` gets everything that the robots' feeds tell. `tell` gets the news, and before that `stop` what asks
    for a stop: both are called in the thread that predicts, and must return at once. Without `stop` a rule
    only says that it would. With `wearing`, which says whose walk a robot's recording is of, models are
    adapted to wearers, and `tell` is told of that in another thread.
    """

    def __init__(
        self,
        settings: ServerSettings,
        tell: Callable[[Sequence[PredictionNews]], None],
        stop: Callable[[Ruled], None] | None = None,
        wearing: Callable[[str], Wearing] | None = None,
    ) -> None:
        self._settings = settings
        self._tell = tell
        self._stop = stop
        self._serving = ModelLoader(settings.store.url, settings.prediction.poll_s, settings.promoters)
        self._tracking = TrackRecordUpdates(
            settings.store.url, lambda: {robot for robot, _ in self._serving.models}
        )
        self._adapting = None if wearing is None else AdaptingService(wearing, lambda one: tell([one]))
        self._inbox = Inbox[Event]()
        self._robots: dict[str, RobotPredictor] = {}
        self._calibration: Calibration | None = None
        self._unforeseen: str | None = None  # why danger is not, though it is to be
        self._broken: dict[str, str] = {}  # models, and why
        self._judged = 0
        self._skipped = 0
        self._worker = Worker("prediction", self._run, STILL_S)

    def __enter__(self) -> Self:
        self._serving.__enter__()
        self._tracking.__enter__()
        if self._adapting is not None:
            self._adapting.__enter__()
        self._worker.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._inbox.close()
        self._worker.join()
        if self._adapting is not None:
            self._adapting.__exit__(*exc)
        self._tracking.__exit__(*exc)
        self._serving.__exit__(*exc)

    @property
    def workers(self) -> tuple[Worker, ...]:
        """Its threads, to be watched over."""
        adapting = () if self._adapting is None else (self._adapting.worker,)
        return self._worker, self._serving.worker, self._tracking.worker, *adapting

    def take(self, robot: str, event: Event) -> None:
        """Take an event of a robot's feed; from any thread, returns at once."""
        self._inbox.put(robot, event)

    def say(self, robot: str, number: int, what: Happening) -> None:
        """Accept what was learned from a wearer, decline it, take it back, or try again; from any thread."""
        if self._adapting is not None:
            self._adapting.say(robot, number, what)

    @property
    def models(self) -> Mapping[tuple[str, str], Model]:
        """Serving models, by robot and task; from any thread."""
        return self._serving.models

    @property
    def state(self) -> PredictingState:
        """How it goes now; from any thread."""
        said = self._serving.problem, self._tracking.problem, self._unforeseen
        problems = [one for one in said if one is not None]
        problems += [f"{robot}: {task}: {why}" for (robot, task), why in self._serving.problems.items()]
        problems += self._powerless()
        robots = {robot: _reports(known) for robot, known in self._robots.copy().items()}
        return PredictingState(
            robots,
            (*problems, *self._broken.copy().values()),
            self._tracking.figures,
            self._judged,
            self._skipped + self._inbox.lost,
            {}
            if self._adapting is None
            else {name: one.standing or one.text for name, one in self._adapting.now.items()},
            {
                robot: told
                for robot, known in self._robots.copy().items()
                if (told := known.danger) is not None
            },
        )

    def _powerless(self) -> Iterator[str]:
        """Yield the rules that are to stop a robot, and may not by the model that serves."""
        for (robot, task), model in self._serving.models.items():
            for rule in self._stops(robot, task) if model.objection is not None else ():
                yield f"{robot}: rule {rule.name} CANNOT STOP IT: {model.objection}"

    def _stops(self, robot: str, task: str) -> Iterator[RuleSettings]:
        """Yield the rules that stop this robot by what a task's model says."""
        for rule in self._settings.rules:
            if rule.action is Action.STOP and rule.task == task and rule.concerns(robot):
                yield rule

    # --- the thread that predicts

    def _run(self) -> None:
        try:
            self._calibration = load() if self._settings.prediction.danger else None
        except UnusableModel as error:
            self._unforeseen = f"danger is not foreseen: {error}"
            log.warning("%s", self._unforeseen)
        with threadpool_limits(limits=1):  # small batches gain nothing from more, and the cores are others'
            while (taken := self._inbox.take(BEAT_S)) is not None:
                self._worker.beat()
                try:
                    self._turn(taken)
                except Exception:
                    log.exception("internal error; prediction goes on")

    def _turn(self, taken: "Mapping[str, collections.deque[Event]]") -> None:
        for robot, events in taken.items():
            self._follow(robot, events)
            known = self._robots[robot]
            news, known.danger_news = known.danger_news, []
            self._pass_on(news)
        for model, due in self._due():
            self._worker.beat()
            self._pass_on(self._judge(model, due))

    def _pass_on(self, news: Sequence[PredictionNews]) -> None:
        """Stop what a rule wants stopped, then tell."""
        for one in news:
            if self._stop and isinstance(one, Ruled) and one.stops:
                self._stop(one)
        if news:
            self._tell(news)

    def _follow(self, robot: str, events: "collections.deque[Event]") -> None:
        known = self._robots.get(robot)
        if known is None:
            known = RobotPredictor(robot, self._settings.prediction, self._settings.rules, self._calibration)
            self._robots[robot] = known
        self._serve(known, events)
        if self._adapting is not None:
            self._adapting.seen(robot, events)
        try:
            known.take(events)
        except Exception:  # what a robot sends wrongly disturbs no other
            log.exception("%s sent what nothing can be predicted from; begun anew", robot)
            known.restart()
        if known.units:
            self._serving.robot(robot, known.units)

    def _serve(self, robot: RobotPredictor, events: Iterable[Event]) -> None:
        """Give a robot the models that serve it now, but for those that broke."""
        models, why = _of(robot.robot, self._serving.models), _of(robot.robot, self._serving.why)
        adapted = self._own(robot.robot, events, models.get(GAIT_PHASE))
        models |= {} if adapted is None else {GAIT_PHASE: adapted}
        broken = {
            task: self._broken[model.card.id]
            for task, model in models.items()
            if model.card.id in self._broken
        }
        whole = {task: model for task, model in models.items() if task not in broken}
        news = robot.serve(whole, why | broken)
        if news is not None:
            self._tracking.wake()
        if news is not None and (whole or news.why):
            self._tell([news])

    def _own(self, robot: str, events: Iterable[Event], model: Model | None) -> Model | None:
        """Return the model adapted to the wearer, if it serves and can be used."""
        if self._adapting is None:
            return None
        trusted = model is not None and model.objection is None
        bar = BARRED if trusted and any(self._stops(robot, GAIT_PHASE)) else ""
        every_ns = self._settings.prediction.every_ns(GAIT_PHASE)
        adapted = self._adapting.serves(robot, events, model, every_ns, bar)
        if adapted is None or adapted.card.id not in self._broken:
            return adapted
        self._adapting.broke(robot)
        return None

    def _due(self) -> Iterator[tuple[Model, list[tuple[RobotPredictor, Watched]]]]:
        """Yield the due windows, by model: robots with the same model are judged together."""
        found: dict[str, tuple[Model, list[tuple[RobotPredictor, Watched]]]] = {}
        for robot in self._robots.values():
            for watched in robot.tasks.values():
                if watched.due:
                    self._skipped += watched.skip_late()
                    model = watched.model
                    found.setdefault(model.card.id, (model, []))[1].append((robot, watched))
        yield from found.values()

    def _judge(self, model: Model, due: Sequence[tuple[RobotPredictor, Watched]]) -> list[PredictionNews]:
        """Return a model's predictions for all due windows; an exception disables only this model."""
        windows = [window for _, watched in due for window in watched.due]
        try:
            predictions = iter(judged(model.card.id, model.learned, windows))
        except Exception as error:
            log.exception("the model %s breaks; it serves no more", model.card.id)
            self._broken[model.card.id] = f"{model.card.id}: {BROKEN}{type(error).__name__}"
            return []
        news: list[PredictionNews] = []
        for robot, watched in due:
            if self._adapting is not None and model.card.task == GAIT_PHASE:
                self._adapting.asked(robot.robot, watched.due)
            own = [next(predictions) for _ in watched.due]
            quality = self._tracking.quality(robot.robot, model.card)
            news += watched.predicted(robot.robot, robot.clock, quality, own)
        self._judged += len(windows)
        return news


def _of(robot: str, found: Mapping[tuple[str, str], Thing]) -> dict[str, Thing]:
    """Return the entries of this robot, by task."""
    return {task: found[robot, task] for task in TASKS if (robot, task) in found}


def _reports(robot: RobotPredictor) -> dict[str, TaskReport]:
    newest = {task: watched.newest for task, watched in robot.tasks.copy().items()}
    return {task: _report(known) for task, known in newest.items() if known is not None}


def _report(known: Predicted) -> TaskReport:
    prediction, trust = known.prediction, known.trust
    return TaskReport(
        prediction.model,
        known.card.made,
        prediction.label,
        prediction.probability,
        known.utc_ns / 1e9,
        None if known.took_ns is None else known.took_ns / 1e9,
        trust.level.value,
        trust.novelty,
        trust.abnormal,
        trust.unknown,
        trust.drifted,
    )
