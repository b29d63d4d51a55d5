"""Runs a scenario: robot and gateway, what happens to them, and what came of what was expected."""

import time
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from hil_sim.clock import SECOND_NS
from hil_sim.errors import SimulatorError
from hil_sim.faults.fault import FaultTarget
from hil_sim.faults.registry import FAULTS
from hil_sim.operator import Operator
from hil_sim.robot import SimulatedRobot
from hil_sim.scenario.expectation import Expectation, Observed, ScenarioResult, Verdict
from hil_sim.scenario.gateway import GatewayLink, GatewayProcess
from hil_sim.scenario.lateness import Lateness
from hil_sim.scenario.observer import Observer
from hil_sim.scenario.script import Script, ScriptStep
from hil_sim.scenario.table import ScenarioError
from hil_sim.scenario.waiting import Waiting

GATEWAY_LOG = "gateway.log"
_LOOK_NS = SECOND_NS // 2  # how often to look whether everything is decided


@dataclass(frozen=True, slots=True)
class ScenarioOutcome:
    """Result of a scenario; `skipped_s` is simulated time that the computer was too slow for.

    `problem` says why it could not be run; then there are no verdicts.
    """

    verdicts: tuple[Verdict, ...] = ()
    skipped_s: float = 0.0
    seconds: float = 0.0  # that it took, in real time
    problem: str = ""

    @property
    def result(self) -> ScenarioResult:
        if self.problem:
            return ScenarioResult.NOT_RUN
        found = {verdict.result for verdict in self.verdicts}
        return next(
            (one for one in (ScenarioResult.FAILED, ScenarioResult.INCONCLUSIVE) if one in found),
            ScenarioResult.PASSED,
        )

    @property
    def doubt(self) -> str:
        """The first reason for which something is inconclusive; "" where nothing is."""
        return next((verdict.doubt for verdict in self.verdicts if verdict.doubt), "")


def schedule(lines: tuple[ScriptStep, ...], robot: SimulatedRobot) -> None:
    """Let what happens to the robot itself happen at its time; what cannot be done then ends the run.

    Raises:
        ScenarioError: a line needs a gateway, and there is none.

    """
    for line in lines:
        if line.for_gateway is not None:
            raise ScenarioError(f"{line.where}: {line.for_gateway!r} needs a gateway: gwrms sim run")
        robot.exoskeleton.clock.at(round(line.time_s * SECOND_NS), partial(_obey, robot.operator, line))


def _obey(operator: Operator, line: ScriptStep) -> None:
    try:
        operator.obey(line.request)
    except SimulatorError as error:
        raise ScenarioError(f"{line.where}, at {line.time_s:g} s: {error}") from error


def run(script: Script, folder: Path, speed: float | None = 1.0) -> ScenarioOutcome:
    """Run a scenario in `folder` and judge it; the gateway lives in real time whatever `speed` is.

    What it could not be run for is the outcome's problem.
    """
    began = time.monotonic()
    try:
        outcome = _run(script, folder, speed)
    except SimulatorError as error:
        outcome = ScenarioOutcome(problem=str(error))
    return replace(outcome, seconds=time.monotonic() - began)


def _run(script: Script, folder: Path, speed: float | None) -> ScenarioOutcome:
    robot = SimulatedRobot(
        folder,
        script.scenario,
        script.seed,
        speed=speed,
        epoch_s=time.time(),
        sensors=script.sensors,
        person=script.subject,
        drives=script.drives,
        guard=script.guard,
        walk=script.walks,
    )
    with ExitStack() as stack:
        robot.open()
        stack.callback(robot.close)
        schedule(tuple(line for line in script.lines if line.for_gateway is None), robot)
        armed = "heartbeat_ms" in (script.guard or {})
        gateway = GatewayProcess(robot.config, folder / GATEWAY_LOG, armed=armed)
        address = stack.enter_context(gateway)
        link = stack.enter_context(closing(GatewayLink(robot.loop, address)))
        observer = Observer(robot.exoskeleton, link)
        lateness = _watch(robot, gateway)
        for line in script.lines:
            if line.for_gateway is not None:
                ask = partial(observer.ask, line.for_gateway, line.request[line.for_gateway])
                robot.exoskeleton.clock.at(round(line.time_s * SECOND_NS), ask)
        robot.exoskeleton.clock.every(_LOOK_NS, partial(_end_early, robot, script, observer))
        robot.run(script.seconds)
        skipped_s = robot.loop.skipped_ns / SECOND_NS
    judged = tuple(_judge(one, script.lines, observer.observed, lateness) for one in script.expectations)
    return ScenarioOutcome(judged, skipped_s)


def _watch(robot: SimulatedRobot, gateway: GatewayProcess) -> Lateness:
    """Watch whether both get time; a fault may take it from the gateway, as scenarios want."""
    waiting = Waiting(gateway.pid)

    def waited_s() -> float:
        found_s = waiting.take_s()
        on_purpose = any(FAULTS[active.name].on is FaultTarget.HOST for active in robot.faults.active)
        return 0.0 if on_purpose else found_s

    return Lateness(robot.exoskeleton.clock, lambda: robot.loop.take_late_ns() / SECOND_NS, waited_s)


def _judge(
    expectation: Expectation, lines: tuple[ScriptStep, ...], observed: Observed, lateness: Lateness
) -> Verdict:
    """Return the verdict, in doubt if time was lost since the last event before its window."""
    verdict = expectation.judge(observed)
    if verdict.ok:
        return verdict
    timing = expectation.timing
    since_s = max((line.time_s for line in lines if line.time_s <= timing.begin_s), default=0.0)
    return replace(verdict, doubt=lateness.doubt(timing, since_s, verdict.decided_s))


def _end_early(robot: SimulatedRobot, script: Script, observer: Observer) -> None:
    """Nothing is to happen any more, and nothing can change a verdict."""
    now_s = robot.exoskeleton.clock.now_s
    if all(line.time_s < now_s for line in script.lines) and not any(
        one.is_open(observer.observed, now_s) for one in script.expectations
    ):
        robot.stop()
