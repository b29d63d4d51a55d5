"""Danger prediction for the one robot on the screen, in the screen's own thread; no rule acts here."""

from collections.abc import Callable, Iterable, Sequence

from ml.danger.calibration import load
from ml.errors import UnusableModel
from server_gui.core.follow.events import Event
from server_gui.core.prediction.news import PredictionNews
from server_gui.core.prediction.robot_predictor import RobotPredictor
from server_gui.core.settings.prediction import PredictionSettings


class DangerPrediction:
    """Predicts danger from a feed's events; a failure is reported once by `tell`, and the screen goes on."""

    def __init__(self, robot: str, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._predictor: RobotPredictor | None = None
        try:
            self._predictor = RobotPredictor(robot, PredictionSettings(), (), load())
        except UnusableModel as error:
            tell(f"danger is not foreseen: {error}")

    def take(self, events: Iterable[Event]) -> Sequence[PredictionNews]:
        """Feed events in; return the news to show."""
        predictor = self._predictor
        if predictor is None:
            return ()
        try:
            predictor.take(events)
        except Exception as error:  # noqa: BLE001 - whatever a robot sends, the screen and its STOP go on
            self._predictor = None
            self._tell(f"danger is not foreseen any more: internal error, {type(error).__name__}")
        news, predictor.danger_news = predictor.danger_news, []
        return news
