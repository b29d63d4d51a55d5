"""`gwrms ab` and `gwrms sweep`: two values tried against each other, or several one after another."""

import argparse
import os
import re
import select
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import msgspec
from msgspec.structs import replace

from gateway.cli.arguments import number
from gateway.cli.connect import check_names, connect, parameter_names, parser
from gateway.cli.set import change_of, value_of
from gateway.cli.text import say, say_json, warn
from gateway.client import ClientError, Robot
from gateway.units import Unit
from gateway.wire.parameter import ParameterInfo
from gateway.wire.robot import Description
from ml.store.private import private_files
from server_gui.cli.edits import fields, shown
from server_gui.core.evidence.file import EditEvidence, EvidenceFile, folder_beside
from server_gui.core.experiments.machine import ExperimentState
from server_gui.core.experiments.plan import (
    FEWEST_PAIRS,
    MOST_PAIRS,
    USUAL_CYCLES,
    USUAL_PAIRS,
    USUAL_TRANSIENT,
    BadPlan,
    Bounds,
    Dwell,
    ExperimentPlan,
    ab,
    sweep,
)
from server_gui.core.experiments.result import result
from server_gui.core.experiments.run import Run
from server_gui.core.experiments.wording import ending, progress, stated
from server_gui.core.fleet.collector import CollectorReport
from server_gui.core.fleet.control_socket import NobodyCollects, ask
from server_gui.core.follow.feed import FollowSettings
from server_gui.core.settings.server_file import load
from server_gui.processes.shutdown_signals import ShutdownRequested, ShutdownSignals
from server_gui.terminal.followed_robot import FollowedRobot

BEAT_S: Final = 0.1
REACH_S: Final = 10.0  # until a robot has told what it is made of
RATE_HZ: Final = 100.0
NEGATIVE: Final = re.compile(r"-[\d.]")
NOT_CONFIRMED: Final = 3  # exit status
RULES: Final = """
Each value is a trial: the robot reverts it by itself when its time is over, when this command, its
terminal or its computer dies, and when a rule of its guard trips. The experiment ends at once, and the
original value is restored and read back, on any new alarm, a STOP, a refused or reverted trial, a write
by others, a lost link, stale values, the end of walking, an excess of --most-error or --most-current (by
default twice the usual value), and Enter or Ctrl-C. No value is ever kept.
"""
EXIT: Final = """
exit status
  0 all of it was done; 1 it ended early, or could not begin; 2 wrong usage;
  3 NOT CONFIRMED that the value from before is back: look at the robot"""
AB: Final = f"""{RULES}
The order of each pair is random (--seed repeats it), so that drift is not taken for an effect.
gwrms edits show ID prints the results again.

example:
  gwrms ab left_knee.position_gain 3000 2400
{EXIT}"""
SWEEP: Final = f"""{RULES}
Somebody has to watch: the sweep also ends if this command goes into the background, or its input ends.

example:
  gwrms sweep left_knee.position_gain 2400 3600 200
{EXIT}"""

Planner = Callable[[ParameterInfo, float, Unit, Description], ExperimentPlan]


def ab_main(argv: list[str]) -> int:
    """Run `gwrms ab`."""
    made = parser("ab", "Compare two values of a parameter during a walk.", AB)
    made.add_argument("name", metavar="NAME", help="the parameter, as in left_knee.position_gain")
    made.add_argument(
        "values", metavar="VALUE", nargs=2, help="values A and B, in its own unit or another: 3deg"
    )
    made.add_argument(
        "--pairs",
        type=_whole(FEWEST_PAIRS, MOST_PAIRS),
        default=USUAL_PAIRS,
        metavar="N",
        help=f"of A and B, {FEWEST_PAIRS} to {MOST_PAIRS} (default {USUAL_PAIRS})",
    )
    made.add_argument("--seed", type=int, metavar="N", help="seed of the order (default: random)")
    _add_shared(made)
    arguments = made.parse_args(_spaced(argv))

    def plan(info: ParameterInfo, held: float, unit: Unit, description: Description) -> ExperimentPlan:
        first, second = _values(arguments.name, arguments.values, description)
        dwell, bounds = _dwell(arguments), _bounds(arguments)
        values, seed = (first, second), arguments.seed
        return ab(info, held, values, unit, pairs=arguments.pairs, dwell=dwell, bounds=bounds, seed=seed)

    return _run("ab", arguments, plan)


def sweep_main(argv: list[str]) -> int:
    """Run `gwrms sweep`."""
    made = parser("sweep", "Raise a parameter in small steps, while you watch.", SWEEP)
    made.add_argument("name", metavar="NAME", help="the parameter, as in left_knee.position_gain")
    made.add_argument("first", metavar="FROM", help="first value, in its own unit or another: 3deg")
    made.add_argument("last", metavar="TO", help="last value, above FROM")
    made.add_argument("step", metavar="STEP", help="step between two values")
    _add_shared(made)
    arguments = made.parse_args(_spaced(argv))

    def plan(info: ParameterInfo, held: float, unit: Unit, description: Description) -> ExperimentPlan:
        texts = [arguments.first, arguments.last, arguments.step]
        first, last, step = _values(arguments.name, texts, description)
        return sweep(
            info, held, (first, last, step), unit, dwell=_dwell(arguments), bounds=_bounds(arguments)
        )

    return _run("sweep", arguments, plan)


def _add_shared(made: argparse.ArgumentParser) -> None:
    made.add_argument(
        "--cycles",
        type=_whole(3, 60),
        default=USUAL_CYCLES,
        metavar="N",
        help=f"gait cycles that each value is held for (default {USUAL_CYCLES})",
    )
    made.add_argument(
        "--transient",
        type=_whole(0, 20),
        default=USUAL_TRANSIENT,
        metavar="N",
        help=f"gait cycles left out after each change (default {USUAL_TRANSIENT})",
    )
    made.add_argument(
        "--seconds", type=_positive, metavar="S", help="hold each value for so long, instead of cycles"
    )
    made.add_argument("--most-error", type=_positive, metavar="RAD", help="end at this tracking error")
    made.add_argument("--most-current", type=_positive, metavar="A", help="end at this current")
    made.add_argument(
        "--config", type=Path, metavar="FILE", help="the server's file, for the place of the result"
    )


def _spaced(argv: list[str]) -> list[str]:
    """Put a space before what is below zero: argparse would take -3deg for an option."""
    return [f" {word}" if NEGATIVE.match(word) else word for word in argv]


def _whole(least: int, most: int) -> Callable[[str], int]:
    def whole(text: str) -> int:
        text = text.strip()
        if not (text.isascii() and text.isdigit() and least <= int(text) <= most):
            raise argparse.ArgumentTypeError(f"{text!r} is no whole number from {least} to {most}")
        return int(text)

    return whole


def _positive(text: str) -> float:
    text = text.strip()
    value = number(text)
    if not 0.0 < value < 1e9:
        raise argparse.ArgumentTypeError(f"{text!r} is no number above 0 (and below 1e9)")
    return value


def _dwell(arguments: argparse.Namespace) -> Dwell:
    return Dwell(arguments.cycles, arguments.transient, arguments.seconds)


def _bounds(arguments: argparse.Namespace) -> Bounds:
    return Bounds(arguments.most_error, arguments.most_current)


def _values(name: str, texts: list[str], description: Description) -> Iterator[float]:
    for text in texts:
        try:
            change = change_of(f"{name}={text.strip()}")
        except argparse.ArgumentTypeError:
            raise BadPlan(f"{text!r} is no number, with a unit or without, as in 0.42 or 3deg") from None
        yield float(value_of(change, description))


def _run(command: str, arguments: argparse.Namespace, planned: Planner) -> int:
    private_files()
    try:
        plan, unit = _plan(command, arguments, planned)
    except BadPlan as error:
        warn(command, str(error))
        return 1
    say_of(arguments, "\n".join(stated(plan)))
    following = FollowSettings(
        f"gwrms {command}", ("*",), (plan.name,), rate_hz=RATE_HZ, journal_s=1.0, buses_s=2.0
    )
    with ShutdownSignals() as ending_, FollowedRobot(arguments.robot, following) as followed:
        try:
            run = _begin(plan, followed, ending_)
        except BadPlan as error:
            warn(command, str(error))
            return 1
        _follow(run, followed, ending_, arguments)
        # Its last words have their time: a lease that is given back ends what else may be on trial.
    told = result(run, followed.station.who or "this desk", unit)
    if told is not None:
        _keep(told, arguments, command)
    _say_result(run, told, arguments, command)
    if run.state is ExperimentState.NOT_CONFIRMED:
        return NOT_CONFIRMED
    return 0 if run.is_whole else 1


def _plan(command: str, arguments: argparse.Namespace, planned: Planner) -> tuple[ExperimentPlan, str]:
    with connect(arguments, command) as robot:
        description = robot.describe()
        check_names("parameter", [arguments.name], parameter_names(description))
        info = next(
            one
            for one in description.parameters
            if arguments.name in (one.name, f"{one.component}.{one.object}")
        )
        arguments.name = info.name
        if info.problem or info.read_only:
            raise BadPlan(f"{info.name}: {info.read_only or info.problem}")
        held = _held(robot, info.name)
        if any(info.name in trial.before for trial in description.trials):
            raise BadPlan(f"{info.name} is on trial: keep it, or take it back, first")
        return planned(info, held, Unit(info.unit, info.unit, digits=4), description), info.unit


def _held(robot: Robot, name: str) -> float:
    """Return the device's value; a device that was idle for a while may take a moment to answer."""
    until_s = time.monotonic() + REACH_S
    while True:
        held = robot.read(name).values[name]
        if held.value is not None:
            return float(held.value)
        if time.monotonic() > until_s:
            raise BadPlan(f"{name} cannot be read: {(held.problem or '').removeprefix(f'{name}: ')}")
        time.sleep(BEAT_S)


def _begin(plan: ExperimentPlan, followed: FollowedRobot, ending_: ShutdownSignals) -> Run:
    until_s = time.monotonic() + REACH_S
    while True:
        followed.update()
        ending_.check()
        try:
            return followed.station.begin(plan)
        except BadPlan:
            if time.monotonic() > until_s:
                raise
        time.sleep(BEAT_S)


def _follow(
    run: Run, followed: FollowedRobot, ending_: ShutdownSignals, arguments: argparse.Namespace
) -> None:
    """Follow it until it is over; whoever asks to end it waits for what is read back."""
    said = ""
    while not run.is_over:
        followed.update()
        try:
            ending_.check()
        except ShutdownRequested as ended:
            run.halt(str(ended))
        if _is_watched(run):
            run.beat()
        run.tick([one.alarm for one in followed.station.alarms.active])
        said = _say_progress(run, said, arguments)
        time.sleep(BEAT_S)
    if sys.stdout.isatty() and not arguments.json:
        say("\n")
    followed.update()


def _is_watched(run: Run) -> bool:
    """Return whether this command is in the foreground; a line on its standard input ends the experiment."""
    try:
        if sys.stdin.isatty() and os.tcgetpgrp(sys.stdin.fileno()) != os.getpgrp():
            return False
        if not select.select([sys.stdin], [], [], 0)[0]:
            return True
        if sys.stdin.readline():
            run.halt("asked for")
            return True
    except (OSError, ValueError):  # it is closed
        return False
    return False


def _say_progress(run: Run, said: str, arguments: argparse.Namespace) -> str:
    """Say it on a terminal in a line that stays in its place; elsewhere in one for each value."""
    if arguments.json:
        now = f"{run.state.name} {run.place}"
        if now != said:
            say_json({"state": run.state.name.lower(), "place": run.place, "of": len(run.plan.steps)})
        return now
    if sys.stdout.isatty():
        text = progress(run)
        sys.stdout.write(f"\r\x1b[K{text[: os.get_terminal_size().columns - 1]}")
        sys.stdout.flush()
        return text
    now = f"{run.state.name} {run.place}"
    if now != said and run.state in (ExperimentState.LOOKING, ExperimentState.HOLDING):
        say(f"{progress(run)}\n")
    return now


def say_of(arguments: argparse.Namespace, text: str) -> None:
    """Say it to people."""
    if not arguments.json:
        say(f"{text}\n")


def _say_result(run: Run, told: EditEvidence | None, arguments: argparse.Namespace, command: str) -> None:
    if arguments.json:
        found = {"ended": run.why, "state": run.state.name.lower(), "result": fields(told) if told else None}
        say_json(found)
        return
    say(f"{ending(run)}\n")
    if told is not None:
        say("\n" + "\n".join(shown(told)) + "\n")
    if run.state is ExperimentState.NOT_CONFIRMED:
        warn(command, f"{run.state.value}: {run.back}. Read it: gwrms get {run.plan.name}")


def _keep(told: EditEvidence, arguments: argparse.Namespace, command: str) -> None:
    """Beside the evidence for edits, with the recording that is made of the robot by a collector here."""
    try:
        spool = load(arguments.config).recorder.spool
        robot, session = _recording(spool, told.edit.robot)
        kept = replace(told, session=session, edit=replace(told.edit, robot=robot))
        EvidenceFile(folder_beside(spool), robot).add(kept)
    except OSError as error:
        warn(command, f"the result is not kept: {error.strerror or error}")


def _recording(spool: Path, calls_itself: str) -> tuple[str, str]:
    """Return the name under which the robot is recorded, and the recording.

    As it calls itself, and none.
    """
    try:
        report = msgspec.json.decode(ask(spool, "status"), type=CollectorReport)
    except (NobodyCollects, ClientError, msgspec.DecodeError):
        return calls_itself, ""
    robots = report.robots.items()
    found = ((name, one.session) for name, one in robots if calls_itself in (name, one.calls_itself))
    return next(found, (calls_itself, ""))
