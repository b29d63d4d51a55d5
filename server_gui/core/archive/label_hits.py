"""How often predictions of that time were right, by the labels within a span of the recording."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from typing import Any

import numpy as np

from ml.registry.registry import Registry
from ml.robot.task import TASKS
from ml.store.labels import Label
from ml.store.sessions import Session
from ml.training.recorded import Recorded
from server_gui.core.archive.recorded_predictions import PastPrediction, said
from server_gui.core.models.names import task_name
from server_gui.core.prediction.scoring import Decisions, compared, counted, proven_classes, quality
from server_gui.core.prediction.state import Quality
from server_gui.core.settings.server_file import ServerSettings
from server_gui.core.threads.answers import Deliver, when_done

Span = tuple[int, int]  # from, up to before: UTC in ns
Found = dict[str, Quality]  # by task


class LabelHits:
    """For the window's thread; `do` reads in another one."""

    def __init__(
        self, settings: ServerSettings, do: Callable[[Callable[[], Any]], "Future[Any]"], deliver: Deliver
    ) -> None:
        self.text = ""
        self._settings = settings
        self._do = do
        self._deliver = deliver
        self._asked: tuple[object, ...] | None = None
        self._is_looking = False

    def look(self, session: Session, span: Span, labels: Sequence[Label]) -> None:
        """Compare what was predicted in a span with these labels: one look at a time, each once."""
        asked = (session.robot, session.session, span, tuple(labels))
        if asked == self._asked or self._is_looking:
            return
        self._asked, self.text, self._is_looking = asked, "", bool(labels)
        settings = self._settings
        if labels:
            when_done(
                self._do(lambda: found(settings, session, span, labels)),
                self._deliver,
                lambda hits: self._came(told(hits)),
                lambda error: self._came(f"not compared with labels: {error}"),
            )

    def _came(self, text: str) -> None:
        self.text, self._is_looking = text, False


def found(settings: ServerSettings, session: Session, span: Span, labels: Sequence[Label]) -> Found:
    """Return how right the predictions of a span were; blocks. Raises as `said`."""
    past = [one for one in said(settings, session, *span) if one.prediction.task in TASKS]
    registry, hits = Registry(settings.store.url), dict[str, Counter[tuple[str, str]]]()
    for (task, model), rows in _by_model(past):
        classes = proven_classes(registry, model, session.session)
        stamps_ns = np.array([one.prediction.stamp_ns for one in rows], np.int64)
        utc_ns = np.array([one.utc_ns for one in rows], np.int64)
        decisions = Decisions(
            stamps_ns, [one.prediction.label for one in rows], [one.prediction.values for one in rows]
        )
        clock = Recorded(stamps_ns, utc_ns, np.empty((len(rows), 0)))
        if classes:
            counts = counted(*compared(labels, clock, TASKS[task], classes, decisions))
            hits.setdefault(task, Counter()).update(counts)
    return {task: quality(counts) for task, counts in hits.items() if counts}


def told(hits: Found) -> str:
    """Return it in words; empty where no prediction was of a labelled time."""
    return " · ".join(f"{task_name(task)} predicted then: {one.text}" for task, one in hits.items())


def _by_model(past: Sequence[PastPrediction]) -> Iterator[tuple[tuple[str, str], list[PastPrediction]]]:
    by_model: dict[tuple[str, str], list[PastPrediction]] = {}
    for one in past:
        by_model.setdefault((one.prediction.task, one.prediction.model), []).append(one)
    yield from by_model.items()
