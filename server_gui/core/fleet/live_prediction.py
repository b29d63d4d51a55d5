"""Prediction while recording: what models say is kept with the recording, and a rule's stop is asked for."""

import logging
import time
from collections.abc import Callable, Sequence

import msgspec

from server_gui.core.fleet.fleet import Fleet
from server_gui.core.follow.events import Failed, StopAnswered
from server_gui.core.follow.network import Network
from server_gui.core.prediction.news import Foreseen, Predicted, Ruled
from server_gui.core.prediction.service import Predicting
from server_gui.core.recording.batching import EventKind
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.rows import Record
from server_gui.core.settings.server_file import ServerSettings

log = logging.getLogger(__name__)

Foresee = Callable[[Sequence[Foreseen]], None]


class Foreseeing(Predicting):
    """`Predicting`, for the robots of a fleet that is recorded; `show` is told of everything afterwards."""

    def __init__(
        self,
        settings: ServerSettings,
        recorder: Recorder,
        fleet: Fleet,
        network: Network,
        show: Foresee | None = None,
    ) -> None:
        super().__init__(settings, self._keep, self._ask_to_stop)
        self._recorder = recorder
        self._fleet = fleet
        self._network = network
        self._show = show

    def _keep(self, news: Sequence[Foreseen]) -> None:
        rows = [record(self._fleet.session(one.robot), one) for one in news if isinstance(one, Predicted)]
        if rows:
            self._recorder.add(*rows)
        for one in news:
            if isinstance(one, Ruled):
                log.warning("%s: %s", one.robot, one.text)
                self._recorder.event(one.robot, EventKind.RULE, one.text, stamp=one.cause.prediction.stamp_ns)
        if self._show is not None:
            self._show(news)

    def _ask_to_stop(self, ruled: Ruled) -> None:
        self._network.run(self._stopped(ruled))

    async def _stopped(self, ruled: Ruled) -> None:
        answer = await self._fleet.stop(ruled.robot, ruled.text)
        after_ms = (time.time_ns() - ruled.cause.utc_ns) / 1e6
        match answer:
            case StopAnswered(stopped=stopped):
                said = ", ".join(f"{name} {state}" for name, state in stopped.drives.items())
            case Failed(reason=reason):
                said = f"failed: {reason}"
        text = f"stop by a rule: {said}; {after_ms:.0f} ms after the sample"
        log.warning("%s: %s", ruled.robot, text)
        self._recorder.event(ruled.robot, EventKind.RULE, text, after_ms=after_ms)


def record(session: str, news: Predicted) -> Record:
    """A row of the table `predictions`."""
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
