"""A thread that keeps the track record: nobody waits for the store, nothing is read that has not changed."""

import logging
from collections.abc import Callable, Set
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Final, Self

from ml.registry.card import Card
from ml.store import NoSuchTable, StoreError
from server_gui.core.prediction.state import Figures, Quality
from server_gui.core.threads.polling import Polling
from server_gui.core.threads.supervision import Worker

if TYPE_CHECKING:
    from server_gui.core.prediction.track_record import TrackRecord

log = logging.getLogger(__name__)

EVERY_S: Final = 60.0
BREAK_OFF_S: Final = 5.0


class TrackRecordUpdates:
    """The track record of the robots that `robots` tells; use it as a context manager: it ends its thread."""

    def __init__(self, store_url: str, robots: Callable[[], Set[str]]) -> None:
        self.figures: Figures | None = None  # replaced as a whole; None: not looked yet
        self.problem: str | None = None  # why they are not known, or old
        self._url = store_url
        self._robots = robots
        self._record: TrackRecord | None = None
        self._looking = Polling("track record", self._look, EVERY_S, BREAK_OFF_S)
        self.wake = self._looking.wake  # look now; from any thread

    @property
    def worker(self) -> Worker:
        """Its thread, to be watched over."""
        return self._looking.worker

    def __enter__(self) -> Self:
        self._looking.__enter__()
        return self

    def __exit__(self, *exc: object) -> None:
        self._looking.__exit__(*exc)

    def quality(self, robot: str, model: Card) -> Quality | None:
        """Return how right a model was on a robot, None without any labels. From any thread."""
        return (self.figures or {}).get(robot, {}).get(model.task, {}).get(model.id)

    def _look(self) -> None:
        robots = self._robots()
        if not robots:
            return
        try:
            from server_gui.core.prediction.track_record import TrackRecord  # brings the models' code

            self._record = self._record or TrackRecord(self._url)
            self.figures = self._record.figures(robots, datetime.now(UTC), lambda: self._looking.ending)
        except NoSuchTable:  # nobody has uploaded anything yet
            self.figures, self.problem = {}, None
        except Exception as error:  # noqa: BLE001 - whatever a library raises, prediction goes on
            self._record = None
            reason = (
                str(error) if isinstance(error, StoreError) else f"internal error, {type(error).__name__}"
            )
            problem = f"predictions are not compared with labels: {reason}"
            if problem != self.problem:
                log.warning("%s", problem)
            self.problem = problem
        else:
            self.problem = None
