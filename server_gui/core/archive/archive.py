"""Everything recorded, as the window works with it: what there is, one session played, its labels, jobs."""

import functools
from pathlib import Path

from gateway.units import Units
from ml.store.sessions import Session
from server_gui.core.archive.collected_journals import KeptJournals
from server_gui.core.archive.label_hits import LabelHits
from server_gui.core.archive.labels import SessionLabels
from server_gui.core.archive.library import Library
from server_gui.core.archive.playback import Playback
from server_gui.core.archive.recorded_predictions import said
from server_gui.core.archive.recording_comparison import RecordingComparison
from server_gui.core.cloud.jobs import Job, Jobs, JobState
from server_gui.core.cloud.tape import Tape
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.recording import By
from server_gui.core.follow.news import NewsKind
from server_gui.core.models.models import Models
from server_gui.core.settings.server_file import ServerSettings
from server_gui.core.threads.answers import Deliver, when_done
from server_gui.core.threads.background import Background
from server_gui.core.tuning.edits import brief, unit_of

WHO = "recordings"  # what the news name instead of a robot


class Archive:
    """For the window's thread; `close` ends its own. `file` has the settings, and may not be there yet."""

    def __init__(
        self,
        settings: ServerSettings,
        desk: Desk,
        deliver: Deliver,
        author: str = "",
        file: Path | None = None,
    ) -> None:
        self.settings = settings
        self.file = file
        self.library = Library(settings, deliver, desk.reach)
        self.journals = KeptJournals(settings, self.library.reading.do, deliver)
        self.reading = Background("playback")  # what is played, alone or beside; a look never waits for it
        self.playback = Playback(self.reading.do, deliver, desk.shown)
        self._comparing = Background("comparing")  # reads long: nothing that is played waits for it
        self.compared = RecordingComparison(settings, self._comparing.do, deliver)
        self.hits = LabelHits(settings, self._comparing.do, deliver)
        self.labels = SessionLabels(settings, self.reading.do, deliver, author)
        self.jobs = Jobs(lambda job: deliver(lambda: self._over(job)))
        self.models = Models(
            settings.store.url, deliver, self._robots, author, settings.promoters, desk.reach
        )
        self.models.knock = lambda: self.library.knock(now=True)
        self.tape: Tape | None = None  # of the session that is chosen
        self.problem = ""  # why there is none
        self.chosen: Session | None = None
        self._desk = desk
        self.deliver = deliver

    def close(self, within_s: float) -> bool:
        """End everything; False where something hangs, which only the end of the process ends."""
        parts = (self.jobs, self.models, self.library, self.reading, self._comparing)
        ended = [part.close(within_s) for part in parts]
        return all(ended)

    def look(self) -> None:
        """See now and then whether the store is reached, where something is to go there or was away."""
        reach = self._desk.reach
        if self._desk.recording.by is By.NOBODY and reach.problem is None and reach.list_problem is None:
            return
        if reach.looked_s is None or self.library.is_listed:
            self.library.knock()
        else:
            self.library.look()

    def choose(self, session: Session | None) -> None:
        """Look into this session; its tape comes when it has been read."""
        self.chosen, self.tape, self.problem = session, None, ""
        if session is not None:
            when_done(
                self.reading.do(lambda: Tape.open(self.settings, session)),
                self.deliver,
                lambda tape: self._opened(session, tape),
                lambda error: self._failed(session, error),
            )

    def play(self) -> bool:
        """Play the session that is chosen; False where it cannot be."""
        if self.tape is None:
            return False
        recall = functools.partial(said, self.settings, self.tape.session)
        self.playback.open(self.tape, self._words(self.tape.session.robot), recall)
        self.labels.open(self.tape.session)
        return True

    def _robots(self) -> set[str]:
        """Return those of the server's file, and those that are shown."""
        return {*self.settings.robots, *(station.name for station in self._desk)}

    @property
    def shown_units(self) -> Units:
        """Another one where people have chosen other units."""
        return self._desk.shown.units

    def held_then(self, session: Session) -> list[str]:
        """Return the parameters that it began with, in the window's units; in SI where it tells none."""
        si, said = session.parameter_units, []
        for name, value in session.parameters.items():
            if value is not None and name in si:
                unit = unit_of(name, si[name], self._desk.shown.units)
                said.append(f"{name} = {brief(unit, value)} {unit.symbol}".rstrip())
            elif value is not None:
                said.append(f"{name} = {value:g} (SI)")
        return said

    def _words(self, robot: str) -> dict[str, dict[str, str]]:
        """Return the words of states, which recordings do not have: of the live robot, if it is there."""
        named = (station.robot.description for station in self._desk if station.name == robot)
        described = next((found for found in named if found is not None), None)
        channels = [] if described is None else described.channels
        return {channel.name: channel.enum for channel in channels if channel.enum}

    def _opened(self, session: Session, tape: Tape) -> None:
        if session is self.chosen:
            self.tape = tape

    def _failed(self, session: Session, error: Exception) -> None:
        if session is self.chosen:
            self.problem = str(error)

    def _over(self, job: Job) -> None:
        kind = NewsKind.STATE if job.state is JobState.DONE else NewsKind.WARNING
        self._desk.news.add(kind, WHO, f"{job.name} {job.state.value}: {job.said}")
        self.library.look(now=True)
