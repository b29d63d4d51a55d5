"""State of every robot while recording: sessions, names, journals. For the recorder's thread."""

import logging
from collections.abc import Iterable, Mapping, Sequence

from gateway.wire.control import SignedHead
from gateway.wire.resource import ResourceSnapshot
from gateway.wire.robot import Description
from ml.store.tables import PREDICTIONS
from server_gui.core.follow import validation
from server_gui.core.recording import records
from server_gui.core.recording.batching import Batching, EventKind, Notification
from server_gui.core.recording.clocks import Moment
from server_gui.core.recording.journal_tail import Entry, news
from server_gui.core.recording.losses import Loss
from server_gui.core.recording.records import Facts, Session
from server_gui.core.recording.rows import JournalHead, Record, Run

log = logging.getLogger(__name__)


class Robots:
    """Every robot that something came from; each method gives the records that it makes.

    `heads` are up to where the robots' journals are recorded, or about to be.
    """

    def __init__(self, heads: Mapping[str, JournalHead]) -> None:
        self.heads = dict(heads)
        self._robots: dict[str, Batching] = {}
        self._sessions: dict[str, Session] = {}
        self._before: dict[
            str, tuple[str, int | None]
        ] = {}  # each one's last session, and its clock's UTC at 0
        self._names: dict[str, str] = {}  # what each robot calls itself
        self._signed: dict[str, str] = {}  # the hash of the newest entry that each has signed
        self._told: set[tuple[str, str]] = set()  # robot and problem: each is said once

    def runs(self) -> list[Run]:
        """Return the rows of all robots since the last time."""
        return [run for robot in self._robots.values() for run in robot.runs()]

    def known(self, robot: str) -> Batching:
        """Return one robot; a new one is known from now on."""
        return self._robots.setdefault(robot, Batching(robot))

    def take(self, robot: str, new: Notification) -> Iterable[Record]:
        """Keep a notification; where there is no session it begins one. Raises as `Batching.take`."""
        known = self.known(robot)
        known.check(new)  # else a session would have begun of which nobody is told
        begun = [] if known.session else self.begin(records.begin(robot, Facts(units=known.units)))
        return [*begun, *known.take(new)]

    def begin(self, session: Session) -> list[Record]:
        """Begin a session, and end the one before."""
        begun = session.record()  # may raise: then there is no such session
        ended = self.end(session.robot, Moment.now())
        self.known(session.robot).session = session.name
        self.known(session.robot).clock.session()
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

    def end(self, robot: str, now: Moment) -> list[Record]:
        """End the robot's session, if there is one."""
        known = self.known(robot)
        if known.session:
            self._before[robot] = known.session, known.clock.utc_ns(0)
        known.session = ""
        session = self._sessions.pop(robot, None)
        return [] if session is None else [session.ended(known.clock.recorded_ns(now)).record()]

    def rest(self, robot: str, now: Moment) -> list[Record]:
        """End the robot's session because nobody wants it recorded: what comes until then is no gap."""
        self.known(robot).rest()
        return self.end(robot, now)

    def leave(self, robot: str, now: Moment) -> list[Record]:
        """End its session, and take it for one of those that are followed no more: its name is free."""
        self._names.pop(robot, None)
        self._told = {told for told in self._told if told[0] != robot}
        return self.end(robot, now)

    def sessions(self) -> list[Record]:
        """Return the facts about every open session, once more."""
        return [session.record() for session in self._sessions.values()]

    def end_all(self) -> list[Record]:
        """End every session."""
        now = Moment.now()
        return [record for robot in list(self._sessions) for record in self.end(robot, now)]

    def timed(self, record: Record) -> Record:
        """Return a prediction with the UTC that the row has which it is about; any other record as it is."""
        robot, session, stamp_ns = (record.fields.get(name) for name in ("robot", "session", "stamp_ns"))
        known = self._robots.get(robot or "")
        if record.table != PREDICTIONS.name or known is None or stamp_ns is None:
            return record
        of_sessions = (self._before.get(known.robot, ("", None)), (known.session, known.clock.utc_ns(0)))
        offset_ns = dict(of_sessions).get(
            session or ""
        )  # each session is of one boot, with a clock of its own
        if offset_ns is None:
            return record
        return Record(record.table, record.fields | {"utc": stamp_ns + offset_ns})

    def describe(self, robot: str, description: Description, now: Moment) -> list[Record]:
        """Take the channels' units; a name that differs from `robot`, or is another's too, is an event."""
        self.known(robot).describe({channel.name: channel.unit for channel in description.channels})
        found: list[Record] = []
        if description.robot != robot:
            problem = (
                f"{robot} calls itself {description.robot} in its own file: give it one name, in [robot] "
                f"there or here ({description.robot}=HOST:PORT)"
            )
            found += self._tell(robot, problem, EventKind.NAME, now)
        self._names[robot] = description.robot
        for other in self._others_called(description.robot, robot):
            problem = f"{robot} and {other} both call themselves {description.robot}"
            found += self._tell(robot, problem, EventKind.NAME, now)
        return found

    def _others_called(self, name: str, robot: str) -> list[str]:
        return [each for each, called in self._names.items() if called == name and each != robot]

    def resources(self, robot: str, now: Moment, snapshot: ResourceSnapshot) -> list[Record]:
        """Return a look at the robot's computer."""
        known = self.known(robot)
        return [records.resources(robot, known.session, known.clock.recorded_ns(now), snapshot)]

    def journal(
        self, robot: str, entries: Sequence[Entry], now: Moment, head: SignedHead | None = None
    ) -> list[Record]:
        """Return the new entries in a tail of the robot's journal; `head` belongs to one of them.

        Raises:
            Unfit: it is no journal; what is recorded of it stays as it was.

        """
        validation.journal(entries)
        new = news(entries, self.heads.get(robot))
        found = [records.journal(robot, entry) for entry in new.entries]
        found += self._witnessed(robot, entries, found, head)
        if entries:
            self.heads[robot] = JournalHead(entries[-1]["n"], entries[-1]["hash"])
        if new.missing:
            text = f"{new.missing} entries of the robot's journal were never seen"
            found.append(self.known(robot).now(EventKind.JOURNAL_GAP, text, now, missing=new.missing))
        return found

    def _witnessed(
        self, robot: str, entries: Sequence[Entry], found: list[Record], head: SignedHead | None
    ) -> list[Record]:
        """Put the head to its entry, which is kept once more where it was already."""
        signed = [records.journal(robot, entry, head) for entry in entries if head and entry["n"] == head.n]
        if head is None or not signed:
            return []
        known, self._signed[robot] = self._signed.get(robot), head.hash
        if head.n in (new := [record.fields["n"] for record in found]):
            found[new.index(head.n)] = signed[0]
            return []
        return [] if known == head.hash else signed

    def forget(self, robot: str, kept: Mapping[str, JournalHead]) -> None:
        """Up to where the robot's journal is recorded is what was kept before, or unknown."""
        self.heads.pop(robot)
        if robot in kept:
            self.heads[robot] = kept[robot]

    def lost(self, whose: str, lost: Loss, what: str) -> list[Record]:
        """Return records of rows lost here; for an unknown robot, in every recording."""
        now = Moment.now()
        known = [self.known(whose)] if whose else [*self._robots.values()] or [Batching("")]
        text = f"this server lost rows of {whose or 'all its robots'}: {what}"
        data = {"rows": lost.rows} | dict(zip(("from", "to"), lost.times_ns, strict=False))
        return [robot.now(EventKind.LOST, text, now, **data) for robot in known]

    def refused(self, robot: str, what: str, why: str) -> list[Record]:
        """Return records of invalid data, only for the first time of each `what`."""
        text = f"{robot}: {what}: {why}" if what else f"{robot} sent what cannot be kept: {why}"
        return self._tell(robot, f"refused {what}", EventKind.REFUSED, Moment.now(), text)

    def _tell(
        self, robot: str, problem: str, kind: EventKind, now: Moment, text: str | None = None
    ) -> list[Record]:
        """Return an event for what is wrong with a robot, and a line in the log: once."""
        if (robot, problem) in self._told:
            return []
        self._told.add((robot, problem))
        log.warning("%s", text or problem)
        return [self.known(robot).now(kind, text or problem, now)]
