"""A scenario file: the robot, what happens to it and when, and what is expected (docs/how-to/bench.md).

`[robot]` has scenario, seconds, seed, subject, imu, insole and drive; each `[[at]]` a time and one thing
that happens; each `[[expect]]` what is looked at, what it must be, and when.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hil_sim import operator, personality
from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import JOINTS, Scenario
from hil_sim.scenario import expect_table
from hil_sim.scenario.expectation import Expectation, When
from hil_sim.scenario.table import ScenarioError, Table
from hil_sim.sensors.suite import IMUS, INSOLES, SensorChoice

_AFTER_S = 1.0  # how long a scenario goes on after the last time that it names
# What a gateway is asked for: the line's key → method of the wire and the name of the parameter.
GATEWAY_LINES = {"stop": ("robot.stop", "reason"), "set": ("parameter.write", "changes")}
NEEDS_LEASE = frozenset({"set"})


@dataclass(frozen=True, slots=True)
class Line:
    """One `[[at]]`: what happens at a time (simulated s); `where` is how errors call it."""

    where: str
    time_s: float
    request: Mapping[str, Any]

    @property
    def for_gateway(self) -> str | None:
        """Which of the things it is that a gateway is asked for; `None` where the robot itself is meant."""
        return next((key for key in GATEWAY_LINES if key in self.request), None)


@dataclass(frozen=True, slots=True)
class Script:
    """A scenario, checked as far as a file can be."""

    title: str = ""
    scenario: Scenario = Scenario.WALK
    seconds: float = 0.0
    seed: int = 0
    subject: int = 0
    sensors: SensorChoice = field(default_factory=SensorChoice)
    drives: Mapping[str, Path] = field(default_factory=dict)
    lines: tuple[Line, ...] = ()
    expectations: tuple[Expectation, ...] = ()


def load(file: Path) -> Script:
    """Read a scenario file; raises `ScenarioError`."""
    try:
        values = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ScenarioError(f"{file}: cannot be read: {error.strerror}") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ScenarioError(f"{file}: this is no TOML: {error}") from error
    top = Table(str(file), values)
    top.only(("title", "robot", "at", "expect"))
    robot = Table(f"{file} [robot]", values.get("robot", {}))
    robot.only(("scenario", "seconds", "seed", "subject", "imu", "insole", "drive"))
    lines = tuple(_line(table) for table in _tables(top, "at"))
    expectations = tuple(one for table in _tables(top, "expect") for one in expect_table.read(table))
    least_s = _AFTER_S + max([0.0, *(line.time_s for line in lines), *map(_known_by, expectations)])
    return Script(
        title=top.text("title", file.stem),
        scenario=Scenario(robot.choice("scenario", list(Scenario), Scenario.WALK)),
        seconds=_duration(robot, least_s),
        seed=robot.whole("seed", 0),
        subject=robot.whole("subject", 0),
        sensors=SensorChoice(
            robot.choice("imu", IMUS, SensorChoice().imu),
            robot.choice("insole", INSOLES, SensorChoice().insole),
        ),
        drives=_drives(robot, file),
        lines=lines,
        expectations=expectations,
    )


def _drives(robot: Table, file: Path) -> dict[str, Path]:
    """`drive = "FILE"`, or a list of `"FILE"` and `"JOINT=FILE"`, beside the scenario's file."""
    given = robot.values.get("drive", [])
    words = [given] if isinstance(given, str) else given
    if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
        raise robot.fail(f'drive = {given!r} is no file: write "FILE", or a list of "FILE" and "JOINT=FILE"')
    try:
        return personality.choose(words, JOINTS, file)
    except SimulatorError as error:
        raise robot.fail(str(error)) from error


def _tables(top: Table, key: str) -> list[Table]:
    found = top.values.get(key, [])
    if not isinstance(found, list):
        raise top.fail(f"{key} is a list of tables: write [[{key}]]")
    return [Table(f"{top.where} [[{key}]] {number}", values) for number, values in enumerate(found, 1)]


def _line(table: Table) -> Line:
    request = {key: value for key, value in table.values.items() if key != "time_s"}
    line = Line(table.where, table.seconds("time_s"), request)
    if line.for_gateway is not None:
        table.only(("time_s", line.for_gateway))
        _check_gateway_line(table, line.for_gateway)
        return line
    try:
        operator.check(request)
    except SimulatorError as error:
        raise table.fail(str(error)) from error
    return line


def _check_gateway_line(table: Table, key: str) -> None:
    if key == "stop":
        table.text(key)
    elif not isinstance(table.values[key], dict) or not table.values[key]:
        raise table.fail('set = {"gait.step_length" = 0.45} is what it looks like')


def _known_by(expectation: Expectation) -> float:
    timing = expectation.timing
    return timing.begin_s if timing.when is When.AT else timing.end_s


def _duration(robot: Table, least_s: float) -> float:
    if "seconds" not in robot:
        return least_s
    given_s = robot.seconds("seconds")
    if given_s < least_s - _AFTER_S:
        raise robot.fail(
            f"seconds = {given_s:g} ends before something that is to happen at {least_s - _AFTER_S:g}"
        )
    return given_s
