"""Two recordings compared in a thread: first what changed, which is quick, then what moved with it."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from ml.store.sessions import Session
from server_gui.core.cloud.configuration_changes import Changes, SessionConfiguration, changes
from server_gui.core.cloud.metric_changes import moved, walk
from server_gui.core.cloud.recordings import Recordings
from server_gui.core.evidence.comparison import Evidence
from server_gui.core.settings.server_file import ServerSettings
from server_gui.core.threads.answers import Deliver, when_done

Do = Callable[[Callable[[], Any]], "Future[Any]"]


class RecordingComparison:
    """For the window's thread; what comes of a pair that nobody looks at any more is dropped."""

    def __init__(self, settings: ServerSettings, do: Do, deliver: Deliver) -> None:
        self.pair: tuple[Session, Session] | None = None  # before, after
        self.changes: Changes | None = None
        self.moved: Evidence | None = None
        self.problem = ""
        self.revision = 0
        self._settings = settings
        self._do = do
        self._deliver = deliver

    def open(self, one: Session, other: Session) -> None:
        """Compare these; the older one is before."""
        pair = (one, other) if _age(one) <= _age(other) else (other, one)
        self.pair, self.changes, self.moved, self.problem = pair, None, None, ""
        self.revision += 1
        settings = self._settings
        facts = self._do(lambda: _facts(settings, pair))
        when_done(facts, self._deliver, lambda found: self._changed(pair, found), self._failing(pair))

    def _changed(self, pair: tuple[Session, Session], found: Changes) -> None:
        if self.pair is not pair:
            return
        self.changes = found
        self.revision += 1
        settings = self._settings
        walks = self._do(lambda: _moved(settings, pair))
        when_done(walks, self._deliver, lambda evidence: self._moved(pair, evidence), self._failing(pair))

    def _moved(self, pair: tuple[Session, Session], found: Evidence) -> None:
        if self.pair is pair:
            self.moved = found
            self.revision += 1

    def _failing(self, pair: tuple[Session, Session]) -> Callable[[Exception], None]:
        def failed(error: Exception) -> None:
            if self.pair is pair:
                self.problem = str(error) or type(error).__name__
                self.revision += 1

        return failed


def _age(session: Session) -> tuple[float, str]:
    began = session.began or session.first
    return (0.0 if began is None else began.timestamp(), session.session)


def _reached(settings: ServerSettings) -> Recordings:
    return Recordings(settings.store.url, settings.recorder.spool)


def _facts(settings: ServerSettings, pair: tuple[Session, Session]) -> Changes:
    known = _reached(settings)
    before, after = (SessionConfiguration.of(known, known.find(one.session, one.robot)) for one in pair)
    return changes(before, after)


def _moved(settings: ServerSettings, pair: tuple[Session, Session]) -> Evidence:
    known = _reached(settings)
    before, after = (walk(known, one) for one in pair)
    return moved(before, after)
