"""A scenario file: the robot, what happens to it and when, and what is expected (docs/how-to/scenarios.md).

`[robot]` has scenario, seconds, seed, subject, walks, imu, insole and drive; `[guard]` is that of the robot's
file, which the gateway judges; each `[[at]]` is a time and one thing that happens; each `[[expect]]` what is
looked at, what it must be, and when.
"""

import contextlib
import fnmatch
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from hil_sim import operator, personality, robot_file
from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import JOINTS, Exoskeleton, Scenario
from hil_sim.gait.walks import NAMES, ORDINARY
from hil_sim.scenario import expect_table
from hil_sim.scenario.expectation import Expectation
from hil_sim.scenario.table import Mistake, ScenarioError, Table, Unusable, is_number, meant
from hil_sim.sensors.suite import IMUS, INSOLES, SensorChoice

T = TypeVar("T")

TABLES = ("at", "expect", "guard", "robot", "title")
ROBOT_KEYS = ("scenario", "seconds", "seed", "subject", "walks", "imu", "insole", "drive")
_AFTER_S = 1.0  # how long a scenario goes on after the last time that it names
# What a gateway is asked for: the line's key → method of the wire and the name of the parameter.
GATEWAY_LINES = {"stop": ("robot.stop", "reason"), "set": ("parameter.write", "changes")}
NEEDS_LEASE = frozenset({"set"})


@dataclass(frozen=True, slots=True)
class ScriptStep:
    """One `[[at]]`: what happens at a time (simulated s); `where` is how errors call it."""

    where: str
    time_s: float
    request: Mapping[str, Any]

    @property
    def for_gateway(self) -> str | None:
        """The gateway's part of the request; `None` if it is for the robot itself."""
        return next((key for key in GATEWAY_LINES if key in self.request), None)


@dataclass(frozen=True, slots=True)
class Script:
    """A scenario, checked as far as a file can be."""

    title: str = ""
    scenario: Scenario = Scenario.WALK
    seconds: float = 0.0
    seed: int = 0
    subject: int = 0
    walks: str = ORDINARY
    sensors: SensorChoice = field(default_factory=SensorChoice)
    drives: Mapping[str, Path] = field(default_factory=dict)
    guard: Mapping[str, Any] | None = None  # as robot.toml has it
    lines: tuple[ScriptStep, ...] = ()
    expectations: tuple[Expectation, ...] = ()


def load(file: Path) -> Script:
    """Read a scenario file; raises `ScenarioError`, with all that is wrong."""
    try:
        values = tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise ScenarioError(f"{file}: cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise ScenarioError(f"{file}: this is no TOML: {error}") from error
    script, mistakes = examined(file, values)
    wrong = [one for one in mistakes if one.severity == "mistake"]
    if wrong:
        raise ScenarioError("\n".join(f"{file}: {one.words}" for one in wrong))
    return script


def examined(file: Path, values: Mapping[str, Any]) -> tuple[Script, list[Mistake]]:
    """Return the contents of a file, and all its mistakes and unlikely values."""
    mistakes: list[Mistake] = []
    return _Reading(file, mistakes).script(values), mistakes


def robot_text(file: Path, values: Mapping[str, Any]) -> str:
    """Return the robot's file as a run of this scenario would write it, but for the port of its bus."""
    script, _ = examined(file, values)
    robot = Exoskeleton(sensors=script.sensors, drives=script.drives)
    return robot_file.text(file.parent.resolve(), robot_file.hub_bus(0), robot, script.guard)


def findings(
    file: Path,
    tables: Mapping[str, Any],
    *,
    machine: bool,  # noqa: ARG001 - of robots
) -> Iterator[tuple[str, str, str, str]]:
    """Return the findings of `gwrms check`: severity, where, key and text."""
    return ((one.severity, one.where, one.key, one.text) for one in examined(file, tables)[1])


class _Reading:
    """One file's tables."""

    def __init__(self, file: Path, mistakes: list[Mistake]) -> None:
        self._file = file
        self._mistakes = mistakes

    def script(self, values: Mapping[str, Any]) -> Script:
        """Return the valid parts of the script."""
        top = Table("", values, self._mistakes)
        self._check_tables(values)
        robot = self._table("robot", values)
        robot.only(ROBOT_KEYS)
        guard = self._table("guard", values) if "guard" in values else None
        rules = frozenset() if guard is None else frozenset(guard.table("rule"))
        lines = tuple(self._each(values, "at", self._line))
        expected = tuple(self._each(values, "expect", lambda table: expect_table.read(table, rules)))
        if "expect" not in values:
            top.warn("expect", "nothing is expected: gwrms sim run takes that for passed, whatever happens")
        _check_answers(lines, values.get("expect"), self._mistakes)
        expectations = tuple(one for some in expected for one in some)
        least_s = _AFTER_S + max(
            [0.0, *(line.time_s for line in lines), *(one.timing.over_s for one in expectations)]
        )
        return Script(
            title=top.text("title", self._file.stem),
            scenario=Scenario(robot.choice("scenario", list(Scenario), Scenario.WALK)),
            seconds=_duration(robot, least_s),
            seed=robot.whole("seed", 0),
            subject=robot.whole("subject", 0, least=0),
            walks=robot.choice("walks", NAMES, ORDINARY),
            sensors=SensorChoice(
                robot.choice("imu", IMUS, SensorChoice().imu),
                robot.choice("insole", tuple(INSOLES), SensorChoice().insole),
            ),
            drives=self._drives(robot),
            guard=None if guard is None else guard.values,
            lines=lines,
            expectations=expectations,
        )

    def _table(self, key: str, values: Mapping[str, Any]) -> Table:
        """Return the table of that name; where it is none, one without anything."""
        try:
            return Table(f"[{key}]", values.get(key, {}), self._mistakes)
        except Unusable:
            return Table(f"[{key}]", {}, self._mistakes)

    def _check_tables(self, values: Mapping[str, Any]) -> None:
        for key in values:
            if key not in TABLES:
                said = f"is not known: {meant(key, TABLES)}allowed are {', '.join(TABLES)}"
                self._mistakes.append(Mistake(f"[{key}]", "", said))

    def _each(self, values: Mapping[str, Any], key: str, read: Callable[[Table], T]) -> Iterator[T]:
        """Yield the result for each entry of a list; an unusable one does not hide the next."""
        found = values.get(key, [])
        if not isinstance(found, list):
            self._mistakes.append(Mistake(f"[{key}]", "", f"is a list of tables: write [[{key}]]"))
            return
        for number, entry in enumerate(found, 1):
            with contextlib.suppress(Unusable):
                yield read(Table(f"[[{key}]] number {number}", entry, self._mistakes))

    def _drives(self, robot: Table) -> dict[str, Path]:
        """`drive = "FILE"`, or a list of `"FILE"` and `"JOINT=FILE"`, beside the scenario's file."""
        given = robot.values.get("drive", [])
        words = [given] if isinstance(given, str) else given
        if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
            text = f'{given!r} is no file: write "FILE", or a list of "FILE" and "JOINT=FILE"'
            robot.complain("drive", text)
            return {}
        try:
            return personality.choose(words, JOINTS, self._file)
        except SimulatorError as error:
            robot.complain("drive", str(error).removeprefix("drive "))
            return {}

    def _line(self, table: Table) -> ScriptStep:
        request = {key: value for key, value in table.values.items() if key != "time_s"}
        line = ScriptStep(f"{self._file} {table.where}", table.seconds("time_s"), request)
        if line.for_gateway is not None:
            table.only(("time_s", line.for_gateway))
            _check_gateway_line(table, line.for_gateway)
            return line
        try:
            verb = operator.verb_of(request)
        except SimulatorError as error:
            raise table.unusable(str(error)) from error
        allowed = (verb, *operator.further(verb))
        table.only(("time_s", *allowed))
        try:
            operator.check({key: value for key, value in request.items() if key in allowed})
        except SimulatorError as error:
            table.complain(verb, str(error))
        return line


def _check_gateway_line(table: Table, key: str) -> None:
    if key == "stop":
        table.text(key)
    elif not isinstance(table.values[key], dict) or not table.values[key]:
        table.complain(key, '{"gait.step_length" = 0.45} is what it looks like')
    else:
        for name, value in table.values[key].items():
            if not is_number(value):
                text = f'{name} = {value!r} is no number: {{"gait.step_length" = 0.45}} is what it looks like'
                table.complain(key, text)


def _check_answers(lines: tuple[ScriptStep, ...], entries: object, mistakes: list[Mistake]) -> None:
    """Check that only what this file asks for is expected to be answered."""
    asked = {line.for_gateway for line in lines if line.for_gateway is not None}
    for number, entry in enumerate(entries if isinstance(entries, list) else (), 1):
        glob = entry.get("answer") if isinstance(entry, dict) else None
        if isinstance(glob, str) and not fnmatch.filter(asked, glob.partition(".")[0]):
            text = f"no [[at]] of this file asks for {glob.partition('.')[0]!r}: " + (
                ", ".join(sorted(asked)) or "none asks"
            )
            mistakes.append(Mistake(f"[[expect]] number {number}", "answer", text))


def _duration(robot: Table, least_s: float) -> float:
    if "seconds" not in robot:
        return least_s
    given_s = robot.seconds("seconds")
    if given_s < least_s - _AFTER_S:
        end_s = least_s - _AFTER_S
        robot.complain("seconds", f"{given_s:g} ends before something that is to happen at {end_s:g}")
    return given_s
