"""What could be foreseen of a robot, without any detector."""

import time

from ml.danger.detector import DETECTORS
from ml.danger.levels import Level
from ml.danger.monitor import DangerVerdict
from server_gui.core.prediction.danger import prediction
from server_gui.core.prediction.news import Endangered
from tests.unit.prediction.robots import ROBOT

HOT = "left knee: the motor grows too hot"


def endangered(level: Level, number: float | None = 0.62, *, stamp_ns: int = 0) -> Endangered:
    """A verdict, just now; of what is unknown all but one detector are silent."""
    silent = DETECTORS[1:] if level is Level.UNKNOWN else ()
    verdict = DangerVerdict(stamp_ns, number, level, (HOT,) if level > Level.NONE else (), silent)
    return Endangered(ROBOT, verdict, prediction(verdict), time.time_ns(), 20_000_000)
