"""The demo: simulator and gateway as processes, a view on them, and all three ended together."""

import contextlib
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from server_gui.core.settings.server_file import (
    RecordingSettings,
    RobotSettings,
    ServerSettings,
    StoreSettings,
)
from server_gui.processes.ending import Ended, Ending
from server_gui.processes.simulated import simulated_robot
from server_gui.terminal import headless
from server_gui.terminal.controls import Controls
from server_gui.terminal.dashboard import Dashboard, save_picture
from server_gui.terminal.followed_robot import FollowedRobot

WHOLE_S = 60.0  # for every component to be there
TICK_S = 0.05
LINE_S = 1.0
DEMO_BATCH_S = 10.0  # of recording that go to the store together: soon enough to be looked at


class DemoFailed(Exception):
    """The run did not show what a demo must show."""


@dataclass(frozen=True, slots=True)
class Options:
    """What the command line asked for."""

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
    with Ending() as ending, _folder(options.folder) as folder:
        try:
            with simulated_robot(folder, options.scenario, ending.check) as (address, check):
                if options.window:
                    return _window(str(address), options.seconds, folder)
                with FollowedRobot(address) as session:
                    _view(session, options, str(address), check)
        except Ended as ended:
            return ended.status
    return 0


def _window(address: str, seconds: float | None, folder: Path) -> int:
    """What it records stays in the demo's folder: nothing simulated comes among real recordings."""
    from server_gui.app import run  # Qt is only here when it is wanted
    from server_gui.core.desk.feeds import Record

    store = StoreSettings((folder / "store").absolute().as_uri())
    recorder = RecordingSettings(spool=folder / "spool", batch_s=DEMO_BATCH_S)
    settings = ServerSettings({"simulated": RobotSettings(address)}, store, recorder)
    return run(settings, seconds=seconds, record=Record("demo", "gwrms demo"))


@contextlib.contextmanager
def _folder(wanted: Path | None) -> Iterator[Path]:
    if wanted is not None:
        yield wanted
        return
    with tempfile.TemporaryDirectory(prefix="gwrms-demo-") as made:
        yield Path(made)


def _view(session: FollowedRobot, options: Options, where: str, check: Callable[[], None]) -> None:
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


def _picture(path: Path | None, session: FollowedRobot, controls: Controls, where: str) -> None:
    if path is not None:
        save_picture(path, session.station, controls, where)


def _wait_whole(session: FollowedRobot, check: Callable[[], None]) -> None:
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


def _headless(session: FollowedRobot, seconds: float | None, check: Callable[[], None]) -> None:
    summary, robot, processing = session.begin_summary(), session.station.robot, session.station.processing
    began = time.monotonic()
    next_line = began + LINE_S
    try:
        while seconds is None or time.monotonic() < began + seconds:
            check()
            session.update()
            if time.monotonic() >= next_line:
                headless.say(headless.line(robot, processing.derived().gait, next_line - began))
                next_line += LINE_S
            time.sleep(TICK_S)
    finally:
        # Also of a run that was cut short.
        headless.say(headless.table(summary, processing.derived().gait, robot))
    failures = summary.failures()
    if failures:
        raise DemoFailed(f"this was no walk: {'; '.join(failures)}")
    headless.say("The joints moved, the feet alternated, no component was lost.")
