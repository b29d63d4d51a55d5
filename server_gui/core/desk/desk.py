"""All robots of the window, which one is looked at, and how things are shown."""

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field

from gateway.units import Units
from gateway.wire.stop import Stopped
from server_gui.core.alarms.alarm import Alarm, Alarms
from server_gui.core.alarms.texts import LEFT, Kind
from server_gui.core.cloud.store_reach import StoreReach
from server_gui.core.desk.frame_rate import FrameRate
from server_gui.core.desk.left import Left, left_alarm
from server_gui.core.desk.pins import Pins
from server_gui.core.desk.recording import By, Recording
from server_gui.core.desk.station import Station
from server_gui.core.desk.stop_all import StopAll, StopAllResult
from server_gui.core.evidence.file import EditEvidence
from server_gui.core.follow.news import News, NewsKind
from server_gui.core.prediction.adaptation import Happening
from server_gui.core.tuning.stop import Sent

log = logging.getLogger(__name__)


@dataclass(slots=True)
class Shown:
    """How things are shown."""

    units: Units = field(default_factory=Units)
    revision: int = 0

    def change(self, units: Units) -> None:
        """Show in other units from now on."""
        self.units = units
        self.revision += 1


class Desk:
    """The stations in their order; `selected` is None while there is none."""

    def __init__(self) -> None:
        self.stations: list[Station] = []
        self.selected: Station | None = None
        self.news = News()
        self.frames = FrameRate()  # of the window
        self._alarms = Alarms()
        self._left: dict[tuple[Kind, str], Left] = {}
        self._stop_all: StopAll | None = None  # the latest, while one of its robots is not reset
        self.shown = Shown()
        self.reach = StoreReach()  # of the store that is recorded into, and read from
        self._recording = Recording(By.NOBODY, None, lambda call: call(), self.news)
        self._recording.rely_on(self.reach)
        self.pins = Pins()
        self.keep_evidence: Callable[[str, EditEvidence], None] = lambda _robot, _told: None  # on the disk
        self.adapt: Callable[[str, int, Happening], None] = lambda _robot, _number, _what: None
        self.commissioned_alarms: Callable[[], Sequence[Alarm]] = lambda: ()
        self.commissions: Callable[[], bool] = lambda: False  # whether a robot is commissioned in this window
        self.on_select: list[Callable[[Station | None], None]] = []

    def __iter__(self) -> Iterator[Station]:
        return iter(self.stations)

    @property
    def recording(self) -> Recording:
        """What is recorded of the robots; what is marked there is flagged at each of them.

        One that is replaced relies on the store's reach no more, and marks nothing here.
        """
        return self._recording

    @recording.setter
    def recording(self, recording: Recording) -> None:
        old, self._recording = self._recording, recording
        if self._marked in old.on_mark:
            old.on_mark.remove(self._marked)
        if recording is not old:
            old.rely_on(StoreReach())
        recording.rely_on(self.reach)
        recording.on_mark.append(self._marked)

    def _marked(self, text: str, ago_s: float) -> None:
        for station in self.stations:
            station.flag(text, ago_s)

    @property
    def whose(self) -> str:
        """Name of the robot that is looked at, where there are others; "" where it goes without saying."""
        return self.selected.title if self.selected is not None and self.has_several else ""

    @property
    def has_several(self) -> bool:
        """Whether a robot is to be named: there are others, or one that is commissioned beside it."""
        return len(self.stations) > 1 or self.commissions()

    def add(self, station: Station) -> None:
        """Add a robot; the first is selected."""
        self.stations.append(station)
        station.neighbours = self.stations
        if self.selected is None:
            self.select(station)

    def remove(self, station: Station) -> None:
        """Look at it no more; another one is selected where it was."""
        if not station.robot.is_recording:
            left = left_alarm(station)
            kind = NewsKind.CONTROL if left is None else NewsKind.WARNING
            kind = NewsKind.NOT_STOPPED if left is not None and left.kind is Kind.LEFT_UNSTOPPED else kind
            station.tell(kind, "removed" if left is None else f"removed {left.what}")
            if left is not None:
                self._left[left.key] = Left(left, station)
        if self._stop_all is not None:
            self._stop_all.remove(station)
        self.stations.remove(station)
        if self.selected is station:
            self.select(self.stations[0] if self.stations else None)

    def acknowledge(self, station: Station | None, alarm: Alarm) -> None:
        """Note that somebody has read an alarm: of a robot that was removed it is over with that."""
        if station is not None:
            station.acknowledge(alarm)
        elif alarm.kind in LEFT:
            self._left.pop(alarm.key, None)
        elif alarm.kind is Kind.NOT_STOPPED:
            self._alarms.acknowledge(alarm.key)
        else:
            self.recording.alarms.acknowledge(alarm.key)

    @property
    def alarms(self) -> Alarms:
        """Of robots that are not in the list.

        Those that were removed while they were not known to be off, until they are seen again here, and one
        that is commissioned.
        """
        self._left = {key: one for key, one in self._left.items() if not one.is_seen_in(self.stations)}
        left = [one.alarm for one in self._left.values()]
        self._alarms.look([*left, *self.commissioned_alarms()], time.time())
        return self._alarms

    def select(self, station: Station | None) -> None:
        """Look at another robot. Staged edits belong to their robot and stay with it."""
        self.selected = station
        for told in self.on_select:
            told(station)

    def stop_all(self, reason: str) -> None:
        """STOP to every robot, one after another without waiting."""
        self.note_stop_all(self.send_stop_all(reason))

    def send_stop_all(self, reason: str) -> list[tuple[Station, Sent]]:
        """Send it from any thread, at once; the answers are for `note_stop_all`.

        Whatever fails at one robot keeps it from no other: that one's STOP is not confirmed.
        """
        return [(station, _sent(station, reason)) for station in tuple(self.stations)]

    def note_stop_all(self, stops: Sequence[tuple[Station, Sent]]) -> None:
        """Follow what becomes of a STOP ALL that was sent."""
        for station, sent in stops:
            _note(station, sent)
        self._stop_all = StopAll([station for station, _ in stops])

    @property
    def stopped_all(self) -> StopAllResult | None:
        """What became of STOP ALL; None before one, and once every robot is reset."""
        found = None if self._stop_all is None else self._stop_all.look()
        if found is None:
            self._stop_all = None
        return found


def _sent(station: Station, reason: str) -> Sent:
    at_ns = time.monotonic_ns()
    try:
        return station.send_stop(reason)
    except Exception as error:
        log.exception("%s: STOP ALL was not sent, or is not known to be", station.name)
        failed: Future[Stopped] = Future()
        failed.set_exception(RuntimeError(f"nobody knows whether it was sent: {_words(error)}"))
        return Sent(at_ns, failed)


def _note(station: Station, sent: Sent) -> None:
    try:
        station.note_stop(sent)
    except Exception as error:
        log.exception("%s: nobody follows what becomes of its STOP", station.name)
        stopping = station.stopping
        stopping.failed(stopping.number, f"nobody follows what becomes of it: {_words(error)}")


def _words(error: Exception) -> str:
    return f"internal error: {type(error).__name__}: {error}"
