"""What is known of every robot while recording: sessions, names, journals. For the recorder's thread."""

import logging
import time
from collections.abc import Iterable, Mapping, Sequence

from gateway.messages import Description, ResourceSnapshot
from server_gui.core import arriving
from server_gui.core.recording import records
from server_gui.core.recording.gathering import EventKind, Gathering, Notification
from server_gui.core.recording.journals import Entry, news
from server_gui.core.recording.records import Facts, Session
from server_gui.core.recording.rows import JournalHead, Record, Run

log = logging.getLogger(__name__)


class Robots:
    """Every robot that something came from; each method gives the records that it makes.

    `heads` are up to where the robots' journals are recorded, or about to be.
    """

    def __init__(self, heads: Mapping[str, JournalHead]) -> None:
        self.heads = dict(heads)
        self._robots: dict[str, Gathering] = {}
        self._sessions: dict[str, Session] = {}
        self._names: dict[str, str] = {}  # what robots call themselves → robot
        self._told: set[tuple[str, str]] = set()  # robot and problem: each is said once

    def runs(self) -> list[Run]:
        """The rows of all robots since the last time."""
        return [run for robot in self._robots.values() for run in robot.runs()]

    def known(self, robot: str) -> Gathering:
        """One robot; a new one is known from now on."""
        return self._robots.setdefault(robot, Gathering(robot))

    def take(self, robot: str, new: Notification) -> Iterable[Record]:
        """Keep a notification; where there is no session it begins one."""
        known = self.known(robot)
        begun = [] if known.session else self.begin(records.begin(robot, Facts(units=known.units)))
        return [*begun, *known.take(new)]

    def begin(self, session: Session) -> list[Record]:
        """Begin a session, and end the one before."""
        begun = session.record()  # may raise: then there is no such session
        ended = self.end(session.robot)
        self.known(session.robot).session = session.name
        self._sessions[session.robot] = session
        return [*ended, begun]

    def amend(self, robot: str, facts: Facts) -> list[Record]:
        """More is known about the session that goes on."""
        session = self._sessions.get(robot)
        if session is None:
            return []
        amended = session.amended(facts)
        record = amended.record()  # may raise: then it is as if nobody had learned more
        self._sessions[robot] = amended
        return [record]

    def end(self, robot: str) -> list[Record]:
        """End the robot's session, if there is one."""
        self.known(robot).session = ""
        session = self._sessions.pop(robot, None)
        return [] if session is None else [session.ended().record()]

    def sessions(self) -> list[Record]:
        """Of every session that goes on what is known of it, once more."""
        return [session.record() for session in self._sessions.values()]

    def end_all(self) -> list[Record]:
        """End every session."""
        return [record for robot in list(self._sessions) for record in self.end(robot)]

    def describe(self, robot: str, description: Description, utc_ns: int) -> list[Record]:
        """Take the channels' units; a name that differs from `robot`, or is another's too, is an event."""
        self.known(robot).describe({channel.name: channel.unit for channel in description.channels})
        found: list[Record] = []
        if description.robot != robot:
            problem = f"{robot} in the server's file calls itself {description.robot}"
            found += self._tell(robot, problem, EventKind.NAME, utc_ns)
        other = self._names.setdefault(description.robot, robot)
        if other != robot:
            problem = f"{robot} and {other} both call themselves {description.robot}"
            found += self._tell(robot, problem, EventKind.NAME, utc_ns)
        return found

    def resources(self, robot: str, utc_ns: int, snapshot: ResourceSnapshot) -> list[Record]:
        """A look at the robot's computer."""
        return [records.resources(robot, self.known(robot).session, utc_ns, snapshot)]

    def journal(self, robot: str, entries: Sequence[Entry], utc_ns: int) -> list[Record]:
        """What is new in a tail of the robot's journal.

        Raises:
            Unfit: it is no journal; what is recorded of it stays as it was.

        """
        arriving.journal(entries)
        new = news(entries, self.heads.get(robot))
        found = [records.journal(robot, entry) for entry in new.entries]
        if entries:
            self.heads[robot] = JournalHead(entries[-1]["n"], entries[-1]["hash"])
        if new.missing:
            text = f"{new.missing} entries of the robot's journal were never seen"
            found.append(self.known(robot).event(EventKind.JOURNAL_GAP, text, utc_ns, missing=new.missing))
        return found

    def forget(self, robot: str, kept: Mapping[str, JournalHead]) -> None:
        """Up to where the robot's journal is recorded is what was kept before, or unknown."""
        self.heads.pop(robot)
        if robot in kept:
            self.heads[robot] = kept[robot]

    def lost(self, rows: int, whose: str = "") -> list[Record]:
        """That rows were lost here; of nobody knows whom: told in the recording of every robot there is."""
        now_ns = time.time_ns()
        if whose in self._robots:
            text = f"this server lost {rows} rows of {whose}"
            return [self._robots[whose].event(EventKind.LOST, text, now_ns, rows=rows)]
        text = f"this server lost {rows} rows of all its robots"
        return [robot.event(EventKind.LOST, text, now_ns, rows=rows) for robot in self._robots.values()]

    def refused(self, robot: str, what: str, why: str) -> list[Record]:
        """That the robot sent what cannot be kept; of each `what` the first time is enough to know it."""
        text = f"{robot}: {what}: {why}" if what else f"{robot} sent what cannot be kept: {why}"
        return self._tell(robot, f"refused {what}", EventKind.REFUSED, time.time_ns(), text)

    def _tell(
        self, robot: str, problem: str, kind: EventKind, utc_ns: int, text: str | None = None
    ) -> list[Record]:
        """An event for what is wrong with a robot, and a line in the log: once."""
        if (robot, problem) in self._told:
            return []
        self._told.add((robot, problem))
        log.warning("%s", text or problem)
        return [self.known(robot).event(kind, text or problem, utc_ns)]
