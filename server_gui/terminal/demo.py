"""The demo: simulator and gateway as processes, a view on them, and all three ended together."""

import contextlib
import json
import re
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from gateway.client import Address
from server_gui.terminal import headless
from server_gui.terminal.children import Child
from server_gui.terminal.controls import Controls
from server_gui.terminal.dashboard import Dashboard, save_picture
from server_gui.terminal.ending import Ended, Ending
from server_gui.terminal.session import Session

START_S = 60.0  # for a simulator or a gateway to become ready, on a slow machine
WHOLE_S = 60.0  # for every component to be there
TICK_S = 0.05
LINE_S = 1.0


class DemoFailed(Exception):
    """The run did not show what a demo must show."""


@dataclass(frozen=True, slots=True)
class Options:
    """What the command line asked for."""

    headless: bool
    seconds: float | None
    folder: Path | None
    scenario: str
    picture: Path | None


def run(options: Options) -> int:
    """The whole demo; returns the exit status.

    Raises:
        ChildFailed: simulator or gateway ended, or never became ready.
        DemoFailed: headless, and the robot did not walk.

    """
    with Ending() as ending, _folder(options.folder) as folder:
        try:
            with _robot(folder, options.scenario, ending) as (address, check), Session(address) as session:
                _view(session, options, str(address), check)
        except Ended as ended:
            return ended.status
    return 0


@contextlib.contextmanager
def _folder(wanted: Path | None) -> Iterator[Path]:
    if wanted is not None:
        yield wanted
        return
    with tempfile.TemporaryDirectory(prefix="gwrms-demo-") as made:
        yield Path(made)


@contextlib.contextmanager
def _robot(folder: Path, scenario: str, ending: Ending) -> Iterator[tuple[Address, Callable[[], None]]]:
    """A running simulator and its gateway: where it listens, and how to check that all is well."""
    with Child("simulator", ["sim", "--dir", str(folder), "--scenario", scenario]) as simulator:
        config = simulator.wait_ready(_config_in, START_S, ending.check)

        def check_simulator() -> None:
            ending.check()
            simulator.check()

        with Child("gateway", ["gateway", config, "--port", "0"]) as gateway:
            address = gateway.wait_ready(_address_in, START_S, check_simulator)

            def check() -> None:
                check_simulator()
                gateway.check()

            yield address, check


def _config_in(line: str) -> str | None:
    """The simulator says `{"ready": true, "config": …}`."""
    try:
        said = json.loads(line)
    except ValueError:
        return None
    return str(said["config"]) if isinstance(said, dict) and said.get("ready") else None


def _address_in(line: str) -> Address | None:
    """The gateway says `listening on HOST:PORT`."""
    said = re.fullmatch(r"listening on (\S+)", line.strip())
    return Address.parse(said[1]) if said else None


def _view(session: Session, options: Options, where: str, check: Callable[[], None]) -> None:
    controls = Controls(session.robot, session)
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

    Dashboard(session.robot, session.processing, controls, where).run(tick)
    _picture(options.picture, session, controls, where)


def _picture(path: Path | None, session: Session, controls: Controls, where: str) -> None:
    if path is not None:
        save_picture(path, session.robot, session.processing.derived().gait, controls, where)


def _wait_whole(session: Session, check: Callable[[], None]) -> None:
    deadline = time.monotonic() + WHOLE_S
    while not session.is_whole():
        check()
        session.update()
        if time.monotonic() > deadline:
            missing = ", ".join(
                f"{part.name} {part.state} ({part.problem or 'no reason known'})"
                for part in session.robot.not_ok()
            )
            reason = missing or session.robot.link.problem or "no telemetry came"
            raise DemoFailed(f"the robot is not whole after {WHOLE_S:g} s: {reason}")
        time.sleep(TICK_S)


def _headless(session: Session, seconds: float | None, check: Callable[[], None]) -> None:
    summary = session.begin_summary()
    began = time.monotonic()
    next_line = began + LINE_S
    try:
        while seconds is None or time.monotonic() < began + seconds:
            check()
            session.update()
            if time.monotonic() >= next_line:
                headless.say(
                    headless.line(session.robot, session.processing.derived().gait, next_line - began)
                )
                next_line += LINE_S
            time.sleep(TICK_S)
    finally:
        headless.say(
            headless.table(summary, session.processing.derived().gait, session.robot)
        )  # also of a run that was cut short
    failures = summary.failures()
    if failures:
        raise DemoFailed(f"this was no walk: {'; '.join(failures)}")
    headless.say("The joints moved, the feet alternated, no component was lost.")
