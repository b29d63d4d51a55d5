"""Danger of the one robot on the screen, foreseen in the screen's own thread; no rule acts here."""

from collections.abc import Callable, Iterable, Sequence

from ml.danger.combine import load
from ml.errors import UnusableModel
from server_gui.core.follow.events import Event
from server_gui.core.prediction.news import PredictionNews
from server_gui.core.prediction.robot_predictor import RobotPredictor
from server_gui.core.settings.prediction import PredictionSettings


class Foreseeing:
    """Where it fails it says so by `tell` once: danger is not known then, and the screen goes on."""

    def __init__(self, robot: str, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._predictor: RobotPredictor | None = None
        try:
            self._predictor = RobotPredictor(robot, PredictionSettings(), (), load())
        except UnusableModel as error:
            tell(f"danger is not foreseen: {error}")

    def take(self, events: Iterable[Event]) -> Sequence[PredictionNews]:
        """Take what the robot's feed has told; what is to be shown of it."""
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
