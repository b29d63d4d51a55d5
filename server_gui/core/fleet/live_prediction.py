"""Prediction while recording: what models say is kept with the recording, and a rule's stop is asked for."""

import concurrent.futures
import functools
import logging
import time
from collections.abc import Callable, Sequence

import msgspec

from gateway.wire.stop import Stopped
from ml.danger.levels import Level
from server_gui.core.fleet.stop_links import StopRobot
from server_gui.core.prediction.adaptation import Adapting, Wearing
from server_gui.core.prediction.news import Endangered, Predicted, PredictionNews, Ruled, turn
from server_gui.core.prediction.service import PredictionService
from server_gui.core.recording.batching import EventKind
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.rows import Record
from server_gui.core.settings.server_file import ServerSettings

log = logging.getLogger(__name__)

TellPredictions = Callable[[Sequence[PredictionNews]], None]


class RecordedPrediction(PredictionService):
    """`PredictionService`, for robots that are recorded; `show` is told of everything afterwards.

    `session` says what a robot's recording is called; `stop` stops a robot. With `wearing` models are adapted
    to who wears the robot by that, where somebody is shown it, who accepts it.
    """

    def __init__(
        self,
        settings: ServerSettings,
        recorder: Recorder,
        session: Callable[[str], str],
        stop: StopRobot,
        show: TellPredictions | None = None,
        wearing: Callable[[str], Wearing] | None = None,
    ) -> None:
        super().__init__(settings, self._keep, self._ask_to_stop, wearing)
        self._recorder = recorder
        self._session = session
        self._stop_robot = stop
        self._show = show
        self._levels: dict[str, Level] = {}  # of danger, by robot
        self._own_models: dict[str, str] = {}  # the adapted model that serves, by robot

    def _keep(self, news: Sequence[PredictionNews]) -> None:
        told = [(self._session(one.robot), one) for one in news if isinstance(one, Predicted)]
        rows = [record(session, one) for session, one in told if session]  # else nothing of it is recorded
        if rows:
            self._recorder.add(*rows)
        for one in news:
            if isinstance(one, Ruled):
                log.warning("%s: %s", one.robot, one.text)
                self._recorder.event(one.robot, EventKind.RULE, one.text, stamp=one.cause.prediction.stamp_ns)
            if isinstance(one, Endangered):
                self._note(one)
            if isinstance(one, Adapting):
                self._note_adapted(one)
        if self._show is not None:
            self._show(news)

    def _note(self, one: Endangered) -> None:
        before, self._levels[one.robot] = self._levels.get(one.robot, Level.NONE), one.verdict.level
        if (happened := turn(before, one.verdict)) is not None:
            log.warning("%s: %s", one.robot, happened)
            told = {"level": one.verdict.level.word, "number": one.verdict.number}
            self._recorder.event(one.robot, EventKind.DANGER, happened, stamp=one.verdict.stamp_ns, **told)

    def _note_adapted(self, one: Adapting) -> None:
        """Without the wearer's name: the session says whose walk it is."""
        before, self._own_models[one.robot] = self._own_models.get(one.robot, ""), one.model
        if one.model == before or not self._session(one.robot):
            return
        text = f"{before} serves no more"
        if one.model and one.tried is not None:
            text = f"{one.model} serves, learned from the wearer's walk: {one.tried.text} of the stride"
        self._recorder.event(one.robot, EventKind.ADAPTED, text, model=one.model or before)

    def _ask_to_stop(self, ruled: Ruled) -> None:
        self._stop_robot(ruled.robot, ruled.text).add_done_callback(functools.partial(self._stopped, ruled))

    def _stopped(self, ruled: Ruled, answer: "concurrent.futures.Future[Stopped]") -> None:
        after_ms = (time.time_ns() - ruled.cause.utc_ns) / 1e6
        text = f"stop by a rule: {_said(answer)}; {after_ms:.0f} ms after the sample"
        log.warning("%s: %s", ruled.robot, text)
        self._recorder.event(ruled.robot, EventKind.RULE, text, after_ms=after_ms)


def _said(answer: "concurrent.futures.Future[Stopped]") -> str:
    if answer.cancelled():
        return "failed: this program ended before the robot had answered"
    if (error := answer.exception()) is not None:
        return f"failed: {error}"
    stopped = answer.result()
    drives = ", ".join(f"{name} {state}" for name, state in stopped.drives.items())
    return drives if stopped.outdated is None else f"{drives}, not confirmed: {stopped.outdated}"


def record(session: str, news: Predicted) -> Record:
    """Return a row of the table `predictions`."""
    said = news.prediction
    fields = {
        "robot": news.robot,
        "session": session,
        "utc": news.utc_ns,
        "stamp_ns": said.stamp_ns,
        "task": said.task,
        "model": said.model,
        "label": said.label,
        "probability": said.probability,
        "novelty": said.novelty,
        "probabilities": msgspec.json.encode(said.probabilities).decode(),
        "values": msgspec.json.encode(said.values).decode(),
    }
    return Record("predictions", fields)
