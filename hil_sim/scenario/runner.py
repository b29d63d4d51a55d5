"""Runs a scenario: robot and gateway, what happens to them, and what came of what was expected."""

import time
from contextlib import ExitStack, closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from hil_sim.clock import SECOND_NS
from hil_sim.errors import SimulatorError
from hil_sim.operator import Operator
from hil_sim.robot import SimulatedRobot
from hil_sim.scenario.expectation import Verdict
from hil_sim.scenario.gateway import GatewayLink, GatewayProcess
from hil_sim.scenario.observer import Observer
from hil_sim.scenario.script import Line, Script
from hil_sim.scenario.table import ScenarioError

_LOOK_NS = SECOND_NS // 2  # how often to look whether everything is decided


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a scenario gave; `skipped_s` is simulated time that the computer was too slow for."""

    verdicts: tuple[Verdict, ...]
    skipped_s: float

    @property
    def ok(self) -> bool:
        return all(verdict.ok for verdict in self.verdicts)


def schedule(lines: tuple[Line, ...], robot: SimulatedRobot) -> None:
    """Let what happens to the robot itself happen at its time; what cannot be done then ends the run.

    Raises:
        ScenarioError: a line needs a gateway, and there is none.

    """
    for line in lines:
        if line.for_gateway is not None:
            raise ScenarioError(f"{line.where}: {line.for_gateway!r} needs a gateway: gwrms sim run")
        robot.exoskeleton.clock.at(round(line.time_s * SECOND_NS), partial(_obey, robot.operator, line))


def _obey(operator: Operator, line: Line) -> None:
    try:
        operator.obey(line.request)
    except SimulatorError as error:
        raise ScenarioError(f"{line.where}, at {line.time_s:g} s: {error}") from error


def run(script: Script, folder: Path, speed: float | None = 1.0) -> Outcome:
    """Run a scenario in `folder` and judge it; the gateway lives in real time whatever `speed` is.

    Raises:
        SimulatorError: it could not be run.

    """
    robot = SimulatedRobot(
        folder,
        script.scenario,
        script.seed,
        speed=speed,
        epoch_s=time.time(),
        sensors=script.sensors,
        person=script.subject,
        drives=script.drives,
    )
    with ExitStack() as stack:
        robot.open()
        stack.callback(robot.close)
        schedule(tuple(line for line in script.lines if line.for_gateway is None), robot)
        address = stack.enter_context(GatewayProcess(robot.config, folder / "gateway.log"))
        link = stack.enter_context(closing(GatewayLink(robot.loop, address)))
        observer = Observer(robot.exoskeleton, link)
        for line in script.lines:
            if line.for_gateway is not None:
                ask = partial(observer.ask, line.for_gateway, line.request[line.for_gateway])
                robot.exoskeleton.clock.at(round(line.time_s * SECOND_NS), ask)
        robot.exoskeleton.clock.every(_LOOK_NS, partial(_end_early, robot, script, observer))
        robot.run(script.seconds)
        skipped_s = robot.loop.skipped_ns / SECOND_NS
    verdicts = tuple(expectation.judge(observer.observed) for expectation in script.expectations)
    return Outcome(verdicts, skipped_s)


def _end_early(robot: SimulatedRobot, script: Script, observer: Observer) -> None:
    """Nothing is to happen any more, and nothing can change a verdict."""
    now_s = robot.exoskeleton.clock.now_s
    if all(line.time_s < now_s for line in script.lines) and not any(
        one.is_open(observer.observed, now_s) for one in script.expectations
    ):
        robot.stop()
