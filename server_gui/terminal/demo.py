"""The demo: simulator and gateway as processes, a view on them, and all three ended together.

What is said is said from the beginning, and what takes long (Qt, tables, plots) is imported meanwhile.
"""

import contextlib
import importlib
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from gateway.client import Address
from server_gui.core.desk.first_steps import FirstStep, FirstSteps
from server_gui.processes.demo_robot import DemoRobot
from server_gui.processes.shutdown_signals import ShutdownRequested, ShutdownSignals
from server_gui.processes.sim_control import start_command
from server_gui.processes.simulated import RobotPart
from server_gui.terminal.output import print_line

if TYPE_CHECKING:  # what takes long to import is imported while simulator and gateway start
    from server_gui.core.desk.station import Station
    from server_gui.terminal.controls import Controls
    from server_gui.terminal.followed_robot import FollowedRobot

DONE = {
    FirstStep.SIMULATOR: "the simulator runs",
    FirstStep.GATEWAY: "the gateway listens",
    FirstStep.WINDOW: "the window is open",
    FirstStep.DATA: "data come from every component",
    FirstStep.WALK: "the robot walks",
}
WHOLE_S = 60.0  # for every component to be there
TICK_S = 0.05
LINE_S = 1.0
WALKS = "walk"  # the scenario
SHOWN_ONLY = (FirstStep.SIMULATOR, FirstStep.GATEWAY)  # of the steps, where the terminal shows the rest
DEMO_BATCH_S = 10.0  # of recording that go to the store together: soon enough to be looked at


class DemoFailed(Exception):
    """The run did not show what a demo must show."""


@dataclass(frozen=True, slots=True)
class Options:
    """Options of the command line."""

    window: bool
    headless: bool
    seconds: float | None
    folder: Path | None
    scenario: str
    picture: Path | None


def run(options: Options) -> int:
    """Run the whole demo, and return the exit status.

    Raises:
        ChildFailed: simulator or gateway ended, or never became ready.
        DemoFailed: headless, and the robot did not walk.

    """
    view = "the window" if options.window else "a view"
    print_line(f"gwrms demo: a simulated exoskeleton, its gateway and {view} start; Ctrl-C ends all of them")
    with ShutdownSignals() as ending, _folder(options.folder) as folder:
        print_line(f"gwrms demo: to walk on after a reset: {start_command(folder)}")
        try:
            with DemoRobot(options.scenario, folder) as own:
                if options.window:
                    return _window(own, options, folder.absolute(), ending.check)
                _in_terminal(own, options, ending.check)
        except ShutdownRequested as ended:
            return ended.status
    return 0


def _window(own: DemoRobot, options: Options, folder: Path, check: Callable[[], None]) -> int:
    """Run the window; its recordings stay in the demo's folder, apart from real ones."""
    from server_gui.views.first_run.splash import Splash
    from server_gui.views.frame.application import application, kept_settings, kept_theme

    steps = FirstSteps(
        partial(_tell_window, own),
        [step for step in FirstStep if step is not FirstStep.WALK or options.scenario == WALKS],
    )
    qt = application()
    splash = Splash(steps, kept_theme(qt, kept_settings()))
    splash.show()
    qt.processEvents()
    check()
    from server_gui.views.first_run.opening import Opening

    opening = Opening(own, steps, splash)
    for _ in import_slowly():
        opening.look()
        qt.processEvents()
        check()
    from server_gui.app import run
    from server_gui.core.desk.feeds import Record
    from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings

    store = StoreSettings((folder / "store").as_uri())
    recorder = RecordingSettings(spool=folder / "spool", batch_s=DEMO_BATCH_S)
    settings = ServerSettings({}, store, recorder)
    status = run(settings, seconds=options.seconds, record=Record("demo", "gwrms demo"), opening=opening)
    own.check()
    return status


def import_slowly() -> Iterator[str]:
    """Import what the window is made of, a part at a time; yields the name of each that is there."""
    for name in ("numpy", "pyarrow.dataset", "deltalake", "pyqtgraph", "server_gui.core.archive.archive"):
        importlib.import_module(name)
        yield name


def _tell(step: FirstStep, took_s: float) -> None:
    print_line(f"{took_s:5.1f} s  {DONE[step]}")


def _tell_window(own: DemoRobot, step: FirstStep, took_s: float) -> None:
    _tell(step, took_s)
    if step is FirstStep.DATA and own.address is not None:
        _tell_address(own.address)


def _tell_address(address: Address) -> None:
    print_line(f"gwrms demo: from another terminal: gwrms describe --robot {address}")


def _in_terminal(own: DemoRobot, options: Options, check: Callable[[], None]) -> None:
    steps = FirstSteps(_tell, SHOWN_ONLY)
    from server_gui.terminal.followed_robot import FollowedRobot  # while the others start

    address = _started(own, steps, check)
    _tell_address(address)

    def check_all() -> None:
        check()
        own.check()

    with FollowedRobot(address) as session:
        session.station.robot.start_by = "" if own.folder is None else start_command(own.folder)
        _view(session, options, str(address), check_all)


def _started(own: DemoRobot, steps: FirstSteps, check: Callable[[], None]) -> Address:
    """Return the gateway's address, once it listens."""
    while True:
        check()
        own.check()
        for part in own.ready:
            steps.reach(FirstStep.SIMULATOR if part is RobotPart.SIMULATOR else FirstStep.GATEWAY)
        if own.address is not None:
            return own.address
        time.sleep(TICK_S)


@contextlib.contextmanager
def _folder(wanted: Path | None) -> Iterator[Path]:
    if wanted is not None:
        yield wanted
        return
    with tempfile.TemporaryDirectory(prefix="gwrms-demo-") as made:
        yield Path(made)


def _view(session: "FollowedRobot", options: Options, where: str, check: Callable[[], None]) -> None:
    from server_gui.terminal.controls import Controls
    from server_gui.terminal.dashboard import Dashboard

    controls = Controls(session.station)
    if options.headless:
        _wait_whole(session, check)
        try:
            _headless(session, options.seconds, check)
        finally:
            _picture(options.picture, session, controls, where)
        return
    ends = None if options.seconds is None else time.monotonic() + options.seconds

    def tick() -> bool:
        check()
        session.update()
        return ends is None or time.monotonic() < ends

    Dashboard(session.station, controls, where).run(tick)
    _picture(options.picture, session, controls, where)


def _picture(path: Path | None, session: "FollowedRobot", controls: "Controls", where: str) -> None:
    if path is not None:
        from server_gui.terminal.dashboard import save_picture

        _leave_out_others(session.station)
        save_picture(path, session.station, controls, where)


def _leave_out_others(station: "Station") -> None:
    """In a picture that others see, no process stands but those that the demo has started."""
    table = station.processes
    if table is not None and isinstance(table.processes, list):
        ours = [process for process in table.processes if is_of_demo(process.pid)]
        station.processes = msgspec.structs.replace(table, processes=ours)


def is_of_demo(pid: int) -> bool:
    """Return whether a process is this one or a child of it; one that is gone is not."""
    try:
        parent = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return False
    return os.getpid() in (pid, int(parent.rpartition(")")[2].split()[1]))


def _wait_whole(session: "FollowedRobot", check: Callable[[], None]) -> None:
    deadline = time.monotonic() + WHOLE_S
    while not session.is_whole():
        check()
        session.update()
        if time.monotonic() > deadline:
            missing = ", ".join(
                f"{part.name} {part.state} ({part.problem or 'no reason known'})"
                for part in session.station.robot.not_ok()
            )
            reason = missing or session.station.robot.link.problem or "no telemetry came"
            raise DemoFailed(f"the robot is not whole after {WHOLE_S:g} s: {reason}")
        time.sleep(TICK_S)


def _headless(session: "FollowedRobot", seconds: float | None, check: Callable[[], None]) -> None:
    from server_gui.terminal import headless

    summary, robot, processing = session.begin_summary(), session.station.robot, session.station.processing
    began = time.monotonic()
    next_line = began + LINE_S
    try:
        while seconds is None or time.monotonic() < began + seconds:
            check()
            session.update()
            if time.monotonic() >= next_line:
                print_line(headless.line(robot, processing.derived().gait, next_line - began))
                next_line += LINE_S
            time.sleep(TICK_S)
    finally:
        # Also of a run that was cut short.
        print_line(headless.table(summary, processing.derived().gait, robot))
    failures = summary.failures()
    if failures:
        raise DemoFailed(f"this was no walk: {'; '.join(failures)}")
    print_line("The joints moved, the feet alternated, no component was lost.")
