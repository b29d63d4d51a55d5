"""Hands everything that one robot's feed tells to the recorder, whole; begins and ends its sessions."""

import time

import msgspec

from gateway.client import ConnectionState
from gateway.wire.robot import Description
from server_gui.core.fleet import session_facts
from server_gui.core.follow.events import (
    BusesSeen,
    Described,
    Event,
    Identified,
    Journalled,
    LinkChanged,
    Looked,
    Refused,
    Resources,
    Telemetry,
)
from server_gui.core.follow.missing_pdos import MissingPdos
from server_gui.core.processing.bus_turns import BusTurns
from server_gui.core.recording.batching import EventKind
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.records import NOBODY, Facts, Worn


class RobotRecording:
    """One robot's recording, in the network's thread.

    A session lasts over dropped links, for as long as the robot's boot, configuration and software stay the
    same; `pause` ends it, `go_on` begins another. Of what comes between, only the robot's journal is kept.
    """

    def __init__(
        self, robot: str, recorder: Recorder, operator: str = "", notes: str = "", worn: Worn = NOBODY
    ) -> None:
        self.session = ""
        self.began_s: float | None = None  # UTC: that session
        self.notes = notes
        self._robot = robot
        self._recorder = recorder
        self._operator = operator
        self.worn = worn
        self._facts = Facts()
        self._same: tuple[str | None, ...] = ()  # boot, configuration and software of this session
        self._linked = False
        self._pdos, self._turns = MissingPdos(), BusTurns()
        self._is_paused = False
        self._description: Description | None = None  # the newest

    def pause(self) -> None:
        """Keep nothing of it from now on."""
        self._is_paused = True
        self.session, self.began_s, self._same = "", None, ()
        self._recorder.end(self._robot)

    def go_on(self, notes: str, worn: Worn | None = None) -> None:
        """Keep everything again, in a new session with these notes, of this wearer; None: the same."""
        self._is_paused, self.notes, self.worn = False, notes, worn or self.worn
        if self._description is not None:
            self._described(self._description)

    def take(self, event: Event) -> None:
        """Record an event; returns at once."""
        if isinstance(event, Described):
            self._description = event.description
        if self._is_paused and not isinstance(event, Journalled | LinkChanged):
            return
        match event:
            case Telemetry():
                offset_ns = None if event.clock is None else event.clock.offset_ns
                self._recorder.record(self._robot, event.stream, event.batch, offset_ns)
            case Resources():
                self._recorder.resources(self._robot, event.snapshot)
                if not isinstance(event.snapshot.kernel, msgspec.UnsetType):
                    self._learn(versions=self._facts.versions | session_facts.kernel(event.snapshot.kernel))
            case Journalled():
                self._recorder.journal(self._robot, event.journal.entries, event.head)
            case Described():
                self._described(event.description)
            case Identified():  # what was so first stays
                self._learn(setup=session_facts.identities(event.devices) | self._facts.setup)
            case Looked() if event.parameters is not None and self._lacks_parameters():
                found = {name: known.value for name, known in event.parameters.values.items()}
                known = {name: one for name, one in self._facts.parameters.items() if one is not None}
                self._learn(parameters=found | known)
            case LinkChanged():
                self._link_changed(event)
            case BusesSeen():
                buses = None if event.buses is None else self._pdos.take(event.buses, event.at_ns)
                for text in self._turns.take(buses, event.at_ns):
                    self._recorder.event(self._robot, EventKind.BUS, text)
            case Refused():
                self._recorder.refused(self._robot, event.what, event.reason)

    def _described(self, description: Description) -> None:
        self._recorder.describe(self._robot, description)
        found = session_facts.facts(description, self._operator, self.notes, self.worn)
        same = (description.boot_id, found.configuration_hash, description.version)
        if same != self._same:
            self._same, self._facts = same, found
            self._pdos, self._turns = MissingPdos(), BusTurns()  # what a session before has told is not in it
            self.session, self.began_s = self._recorder.begin(self._robot, found), time.time()

    def _lacks_parameters(self) -> bool:
        """Return whether a value of the session's beginning is unknown: a busy robot tells some later."""
        known = self._facts.parameters
        return not known or None in known.values()

    def _learn(self, **known: object) -> None:
        """More is known of the session than when it began."""
        found = msgspec.structs.replace(self._facts, **known)
        if found != self._facts:
            self._facts = found
            self._recorder.amend(self._robot, found)

    def _link_changed(self, event: LinkChanged) -> None:
        if self._linked and event.state is ConnectionState.WAITING and not self._is_paused:
            self._recorder.event(self._robot, EventKind.LINK, f"the link dropped: {event.problem}")
        self._linked = event.state is ConnectionState.CONNECTED
