"""One robot as prediction follows it: its rows become windows, its predictions trust, rules and news."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from gateway.client import Batch
from ml.danger.calibration import Calibration
from ml.serving.predictor import Prediction, Row, Window, Windows
from ml.serving.trust import Trusting
from server_gui.core.follow.events import Described, Event, Telemetry
from server_gui.core.prediction.clock import Clock
from server_gui.core.prediction.danger import DangerWatch
from server_gui.core.prediction.danger import News as DangerNews
from server_gui.core.prediction.model_loading import Model
from server_gui.core.prediction.news import Predicted, PredictionNews, Ruled, Serves
from server_gui.core.prediction.rules import PredictionRule
from server_gui.core.prediction.state import DangerReport, Quality
from server_gui.core.settings.prediction import PredictionSettings, RuleSettings

LATE_NS: Final = 500_000_000  # a decision that is due so long before the newest one is skipped


class Watched:
    """One task of one robot, by the model that serves it."""

    def __init__(self, model: Model, every_ns: int, rules: Iterable[RuleSettings]) -> None:
        self.model = model
        self.newest: Predicted | None = None
        self.due: list[Window] = []
        self._every_ns = every_ns
        self._windows = Windows(model.learned.recipe, every_ns)
        self._trusting = Trusting(model.learned.recipe.channels, model.card.ranges)
        self._rules = [PredictionRule(rule, every_ns) for rule in rules if rule.task == model.card.task]

    def take(self, batch: Batch) -> None:
        """Take rows; what is due then is in `due`."""
        self.due += self._windows.push(_rows(batch, self.model.learned.recipe.channels))

    def skip_late(self) -> int:
        """Forget what is due too late; how many."""
        due = self.due
        self.due = [window for window in due if due[-1].stamp_ns - window.stamp_ns <= LATE_NS]
        return len(due) - len(self.due)

    def serve(self, model: Model) -> None:
        """Serve another model from now on; what it looks back on is there if it looks at the same."""
        same = model.learned.recipe.name == self.model.learned.recipe.name
        self._trusting = Trusting(model.learned.recipe.channels, model.card.ranges)
        self.model = model
        if not same:
            self.due = []
            self.restart()

    def restart(self) -> None:
        """Forget everything seen until now."""
        self._windows = Windows(self.model.learned.recipe, self._every_ns)

    def predicted(
        self, robot: str, clock: Clock, quality: Quality | None, predictions: Sequence[Prediction]
    ) -> Iterator[PredictionNews]:
        """Yield the news of these predictions; `quality` is the model's recent accuracy."""
        samples = [window.samples[0, :, -1] for window in self.due]
        self.due = []
        self._trusting.take(predictions, samples)
        for prediction in predictions:
            stamp_ns = prediction.stamp_ns
            self.newest = Predicted(
                robot,
                prediction,
                self.model.card,
                self._trusting.trust,
                clock.utc_ns(stamp_ns),
                clock.age_ns(stamp_ns),
                quality,
                self.model.learned_from,
            )
            for rule in self._rules:
                if (began := rule.take(prediction)) is not None:
                    yield Ruled(robot, rule.settings, began, self.newest, self.model.objection)
            yield self.newest


class RobotPredictor:
    """One robot, for the thread that predicts."""

    def __init__(
        self,
        robot: str,
        settings: PredictionSettings,
        rules: Iterable[RuleSettings],
        calibration: Calibration | None = None,
    ) -> None:
        """Without a `calibration` nothing is said of danger."""
        self.robot = robot
        self.danger_news: list[DangerNews] = []
        self.tasks: dict[str, Watched] = {}
        self.clock = Clock()
        self.units: dict[str, str] = {}
        self._settings = settings
        self._rules = [rule for rule in rules if rule.concerns(robot)]
        self._danger = None if calibration is None else DangerWatch(robot, calibration, self._rules)
        self._boot_id: str | None = None
        self._served: Serves | None = None

    def serve(self, models: Mapping[str, Model], why: Mapping[str, str]) -> Serves | None:
        """Use these models, by task, from now on; return the news, if any. `why` others are refused."""
        for task in self.tasks.keys() - models.keys():
            del self.tasks[task]
        for task, model in models.items():
            if task not in self.tasks:
                self.tasks[task] = Watched(model, self._settings.every_ns(task), self._rules)
            elif self.tasks[task].model is not model:
                self.tasks[task].serve(model)
        serves = Serves(self.robot, {task: model.card for task, model in models.items()}, why)
        if serves == self._served:
            return None
        self._served = serves
        return serves

    @property
    def danger(self) -> DangerReport | None:
        """What was said of danger last; None where it is off, or nothing was said yet."""
        return None if self._danger is None else self._danger.newest

    def restart(self) -> None:
        """Forget everything seen until now."""
        for task in self.tasks.values():
            task.restart()
        if self._danger is not None:
            self._danger.restart()

    def take(self, events: Iterable[Event]) -> None:
        """Take the events of the robot's feed, in order."""
        for event in events:
            match event:
                case Telemetry():
                    self.clock = Clock.of(event.batch, event.clock)
                    for task in self.tasks.values():
                        task.take(event.batch)
                    if self._danger is not None:
                        self.danger_news += self._danger.take(event.batch, self.clock)
                case Described():
                    self.units = {channel.name: channel.unit for channel in event.description.channels}
                    if event.description.boot_id != self._boot_id:
                        self._boot_id = event.description.boot_id
                        self.restart()


def _rows(batch: Batch, channels: Sequence[str]) -> Iterator[Row]:
    """Return a batch's rows with these channels alone; None where it does not have one."""
    nothing: list[float | None] = [None] * len(batch.stamps_ns)
    columns = [batch.columns.get(name, nothing) for name in channels]
    return zip(batch.stamps_ns, zip(*columns, strict=True), strict=True)
