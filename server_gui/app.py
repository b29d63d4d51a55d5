"""The window's wiring: a mailbox a robot, filled by the network's thread; a 30 Hz timer drains and draws."""

import collections
import concurrent.futures
import contextlib
import gc
import os
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from PySide6.QtCore import QObject, QSettings, Qt, QTimer, Signal
from PySide6.QtWidgets import QApplication

from gateway.client import Address
from gateway.wire.resource import ResourceSnapshotParams
from gateway.wire.stop import Stopped
from server_gui.core.archive.archive import Archive
from server_gui.core.commissioning.commissioning import Commissioning
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.feeds import Feeds, Record
from server_gui.core.desk.own_load import OwnLoad
from server_gui.core.desk.shutdown import Shutdown
from server_gui.core.desk.station import Station
from server_gui.core.desk.ticks import Ticks
from server_gui.core.evidence.file import EditEvidence
from server_gui.core.follow.events import Event
from server_gui.core.follow.feed import FollowSettings
from server_gui.core.follow.mailbox import Mailbox
from server_gui.core.prediction.news import PredictionNews
from server_gui.core.settings.server_file import ServerSettings, name_of
from server_gui.core.tuning.link import CommandLink
from server_gui.processes.demo_robot import DemoRobot
from server_gui.processes.file_gateway import FileGateway
from server_gui.processes.interactive_command import talk
from server_gui.processes.sim_control import SimControl, start_command
from server_gui.views.first_run.demo_bar import DemoBar
from server_gui.views.first_run.opening import Opening
from server_gui.views.frame.application import application, kept_settings, kept_theme
from server_gui.views.frame.closing import wait_closed
from server_gui.views.frame.garbage import Garbage
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.frame.saved_state import kept_units
from server_gui.views.frame.stop_keys import StopKeys
from server_gui.views.frame.x11_keys import NoX, X11Keys
from server_gui.views.refresh_rate import SLOW
from server_gui.views.theme import Look, Theme

BY_KEY = "STOP key of the window"
ALL_BY_KEY = "STOP ALL key of the window"
FRAME_MS: Final = 33
SWITCH_S: Final = 0.0005  # a thread that wakes up gets Python within this, however busy the window is
FOLLOWING: Final = FollowSettings(
    client="gwrms gui",
    channels=("*",),
    rate_hz=100.0,
    look_s=1.0,
    resources=ResourceSnapshotParams(limit=1),  # who uses most
    resources_s=2.0,
    journal_s=2.0,
    buses_s=1.0,
)
OWN: Final = "simulated-exo"  # what the window's own robot is called before it has told its name
MOST_PREDICTIONS: Final = 4096  # what may wait for a window that hangs


class Poster(QObject):
    """Brings calls from any thread into the window's, in order."""

    _posted = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self._posted.connect(self._run, Qt.ConnectionType.QueuedConnection)

    def deliver(self, call: Callable[[], None]) -> None:
        """Run this soon in the window's thread."""
        self._posted.emit(call)

    def close(self) -> None:
        """Run nothing more: what it would show is gone."""
        self._posted.disconnect(self._run)

    def _run(self, call: Callable[[], None]) -> None:
        call()


@dataclass(frozen=True, slots=True)
class Followed:
    """A station, and what brings it its facts."""

    station: Station
    mailbox: Mailbox
    link: "concurrent.futures.Future[None]"
    ticks: Ticks  # for where single sources' samples are recorded


class App:
    """Everything from the robots of the server's file to the window that shows them.

    Without `record` it only shows, and so it does as long as another program records into the same spool.
    `opening` is of a simulated robot that has been started already. Without a `theme` it is the one kept.
    """

    def __init__(
        self,
        qt: QApplication,
        settings: ServerSettings,
        kept: QSettings,
        following: FollowSettings,
        record: Record | None = None,
        file: Path | None = None,
        opening: Opening | None = None,
        theme: Theme | None = None,
    ) -> None:
        self._garbage = Garbage()
        self._own_load = OwnLoad()
        self.desk = Desk()
        self._qt = qt
        self._followed: list[Followed] = []
        self._mailboxes: dict[str, Mailbox] = {}
        self._stations: dict[str, Station] = {}
        self._predicted: collections.deque[PredictionNews] = collections.deque(maxlen=MOST_PREDICTIONS)
        self._poster = Poster()
        self._judged: collections.deque[tuple[str, EditEvidence]] = collections.deque(maxlen=MOST_PREDICTIONS)
        self.feeds = Feeds(
            settings,
            following,
            record,
            self._show,
            self._predicted.extend,
            self._stop,
            lambda robot, told: self._judged.append((robot, told)),
        )
        self.desk.recording = self.feeds.recording(self._poster.deliver, self.desk.news)
        self.desk.keep_evidence = self._keep
        self.desk.adapt = self.feeds.adapt
        self._predicts = settings.prediction.enabled
        self._foresees = self._predicts and settings.prediction.danger
        self._opening = opening
        self._own = DemoRobot() if opening is None else opening.own
        self.demo: DemoBar | None = None  # once a simulated robot of ours is followed
        self.desk.shown.units = kept_units(kept)
        self.theme = theme or kept_theme(qt, kept)
        operator = "" if record is None else record.operator
        self._archive = Archive(settings, self.desk, self._poster.deliver, operator, file)
        self.commissioning = Commissioning(talk, who=operator)
        self._gateway: FileGateway | None = None  # of a robot that was commissioned here
        self.ending = Shutdown(self.feeds, self._close_others, self._close_own)
        self.window = MainWindow(self.desk, self.theme, kept, self._archive, self.commissioning)
        self.window.tabs.connect_to.connect(self._start_gateway)
        self.window.stopped.connect(lambda: self.stop("STOP button of the window"))
        self.window.stop_all.connect(lambda: self.stop_all("STOP ALL of the window"))
        self.window.added.connect(self._add)
        self.window.removed.connect(self.leave)
        self.window.simulator.connect(self._own.start)
        self.window.closed.connect(qt.quit)
        self._keys = StopKeys(qt)
        self._keys.pressed.connect(lambda: self.stop(BY_KEY))
        self._keys.all_pressed.connect(lambda: self.stop_all(ALL_BY_KEY))
        self._timer = QTimer(interval=FRAME_MS, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self.tick)
        self._robots = settings.robots
        self._names = {str(robot.where): name for name, robot in settings.robots.items()}  # by the user

    def __enter__(self) -> "App":
        self.feeds.__enter__()
        for name, robot in self._robots.items():
            self.follow(name, robot.where)
        self._timer.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._timer.stop()
        self.ending.finish()

    def close(self) -> None:
        """End everything, and say what is waited for where that takes a moment."""
        self._timer.stop()
        self._poster.close()
        self.window.setUpdatesEnabled(False)  # nothing is drawn any more
        self.window.hide()
        self.ending.begin()
        wait_closed(self.ending, self.theme)

    def quit(self) -> None:
        """End the window; asked again, without waiting."""
        if self.ending.is_begun:
            self.ending.hurry()
        self.window.end()

    def _close_others(self, within_s: float) -> bool:
        asked = self.demo is None or self.demo.end(within_s)
        ended = self.commissioning.close(within_s)
        return self._archive.close(within_s) and asked and ended

    def _close_own(self) -> None:
        """Last, so that nobody misses them."""
        self._own.close()
        if self._gateway is not None:
            self._gateway.close()

    def follow(self, name: str, address: Address) -> Station:
        """Follow another robot from now on."""
        mailbox = Mailbox()
        network = self.feeds.network
        link = CommandLink(network, address, mailbox.put, lambda: self._poster.deliver(station.lost_control))
        is_named = name not in (name_of(str(address)), OWN)
        station = Station(name, str(address), link, self._poster.deliver, self.desk.news, is_named=is_named)
        station.is_overloaded = self._own_load.is_overloaded
        station.is_full = lambda: self._own_load.is_full() or self.desk.frames.is_slow()
        station.predictions.off = not self._predicts
        station.predictions.foresees = self._foresees
        self._mailboxes[name], self._stations[name] = mailbox, station
        self._followed.append(Followed(station, mailbox, network.run(link.run()), Ticks()))
        self.feeds.follow(name, address)
        self.desk.add(station)
        return station

    def _add(self, text: str) -> None:
        """One more robot, `[NAME=]HOST:PORT`; without a name by that which the user has given it before."""
        name, _, where = text.rpartition("=")
        self._names |= {where: name} if name else {}
        name = self._names.get(where, name_of(where))
        self.follow(name_of(where) if name in self._stations else name, Address.parse(where))

    def leave(self, station: Station) -> None:
        """Follow a robot no more; it goes on as it is."""
        followed = next((one for one in self._followed if one.station is station), None)
        if followed is None:
            return
        self.feeds.leave(station.name)
        followed.link.cancel()
        self._followed.remove(followed)
        del self._mailboxes[station.name], self._stations[station.name]
        self.desk.remove(station)

    def stop(self, reason: str) -> None:
        """STOP the robot that is looked at, and one that is commissioned; from any thread."""
        try:
            if (station := self.desk.selected) is not None:
                self._stop(station.name, reason)
        finally:
            self._stop_commissioned()

    def stop_all(self, reason: str) -> None:
        """STOP every robot, and one that is commissioned; from any thread."""
        try:
            stops = self.desk.send_stop_all(reason)
            self._poster.deliver(lambda: self.desk.note_stop_all(stops))
        finally:
            self._stop_commissioned()

    def _stop_commissioned(self) -> None:
        if self.commissioning.runs:
            self.commissioning.stop()

    def _keep(self, robot: str, told: EditEvidence) -> None:
        report = self.desk.recording.link(self._stations[robot].address)
        self.feeds.keep(robot, told, "" if report is None else report.session)

    def _stop(self, robot: str, reason: str) -> "concurrent.futures.Future[Stopped]":
        """STOP a robot, by a key or a rule; from any thread."""
        station = self._stations[robot]
        sent = station.send_stop(reason)
        self._poster.deliver(lambda: station.note_stop(sent))
        return sent.future

    def tick(self) -> None:
        """Take what has come, and draw."""
        for followed in self._followed:
            events = followed.mailbox.drain()
            followed.station.take(followed.ticks.take(events) if self.feeds.by_source else events)
            if followed.link.done():
                followed.link.result()  # it ends only by a mistake of ours, which must not stay unseen
        for robot, told in [self._judged.popleft() for _ in range(len(self._judged))]:
            if robot in self._stations:
                self._stations[robot].judged.take(told)
        for news in [self._predicted.popleft() for _ in range(len(self._predicted))]:
            if news.robot in self._stations:
                self._stations[news.robot].take_prediction(news)
        self.feeds.look(self.desk.recording)
        self._look_at_own()
        self.commissioning.look()
        self._look_at_gateway()
        self._archive.look()
        self.window.refresh()
        self._garbage.look()

    def first_look(self) -> None:
        """Fill in everything, so that nothing is empty that is shown for the first time."""
        for _ in range(SLOW):
            self.tick()

    def _show(self, robot: str, event: Event) -> None:
        """Take events; in the network's thread."""
        mailbox = self._mailboxes.get(robot)  # of one that was left a last event may come
        if mailbox is not None:
            mailbox.put(event)

    # --- the simulated robot

    def _look_at_own(self) -> None:
        own = self._own
        if own.address is not None and self.demo is None:
            self._follow_own(own.address)
        if self.demo is not None:
            self.demo.refresh()
        elif own.problem:
            self.window.empty.say(own.problem, again=True)
        elif self._opening is not None and not self._opening.is_over:
            self.window.empty.say(self._opening.words, again=False)
        if self._opening is not None:
            self._opening.look(self.desk.selected, window=self.window.isVisible())

    # --- a robot that was commissioned here

    def _start_gateway(self, file: str) -> None:
        if self._gateway is not None:
            self._gateway.close()
        self._gateway = FileGateway(Path(file))
        self._gateway.start()
        self.window.tabs.commission.result.say("The gateway is starting …", again=False)

    def _look_at_gateway(self) -> None:
        gateway, result = self._gateway, self.window.tabs.commission.result
        if gateway is None:
            return
        if gateway.problem:
            result.say(gateway.problem, again=True)
        elif gateway.address is not None and not gateway.is_followed:
            gateway.is_followed = True
            result.say(
                f"Connected: its gateway listens on {gateway.address}, until this window closes.", again=False
            )
            self.desk.select(self.follow(name_of(str(gateway.address)), gateway.address))

    def _follow_own(self, address: Address) -> None:
        station = self.follow(OWN, address)
        self.desk.select(station)
        if self._own.folder is not None:
            control = SimControl(self._own.folder)
            station.robot.start_by = f"Start walking, or {start_command(self._own.folder)}"
            deliver = self._poster.deliver
            self.demo = DemoBar(self.window, self._own, control, station, self.theme, deliver)


def run(
    settings: ServerSettings,
    look: Look | None = None,
    scale: float | None = None,
    seconds: float | None = None,
    record: Record | None = None,
    file: Path | None = None,
    signals: Sequence[str] = (),
    opening: Opening | None = None,
) -> int:
    """Open the window until it is closed, or for so many seconds; the exit status.

    `file` has the settings; without one they are not to be changed. `signals` are globs of channels to begin
    with. `opening` is of a simulated robot that starts already.
    """
    sys.setswitchinterval(SWITCH_S)
    qt = application()
    kept = kept_settings()
    theme = kept_theme(qt, kept, look, scale)
    with App(qt, settings, kept, FOLLOWING, record, file, opening, theme) as app:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: app.quit())
        if signals:
            app.window.show_signals(signals)
        app.first_look()
        gc.freeze()  # what was made so far lives as long as the window, and there is much of it
        app.window.show()
        if seconds is not None:
            QTimer.singleShot(round(seconds * 1000), app.window.end)
        with stop_keys(qt, app):
            status = qt.exec()
        app.close()
    if app.ending.hangs:
        os._exit(status)  # what an upload under way has done is found out at the next start
    return status


def stop_keys(qt: QApplication, app: App) -> contextlib.AbstractContextManager[X11Keys | None]:
    """Return the keys that stop even while the window is busy, where there is an X server."""
    if qt.platformName() != "xcb":
        return contextlib.nullcontext()
    try:
        keys = X11Keys(int(app.window.winId()), lambda: app.stop(BY_KEY), lambda: app.stop_all(ALL_BY_KEY))
    except NoX:
        return contextlib.nullcontext()
    app.feeds.others.add(keys.worker)
    return keys
