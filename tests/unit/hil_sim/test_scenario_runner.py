"""How a run judges: what counts as lost time, since when, and how a gateway is ended."""

import signal
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from hil_sim.clock import MILLISECOND_NS
from hil_sim.faults.injector import Active
from hil_sim.robot import SimulatedRobot
from hil_sim.scenario import gateway, runner
from hil_sim.scenario.expectation import Condition, Expectation, Moment, Timing, Track, When
from hil_sim.scenario.gateway import GatewayProcess
from hil_sim.scenario.lateness import Lateness
from hil_sim.scenario.script import ScriptStep

NEVER = Condition("is never so", lambda _: False)
OBSERVED = {Track.TRUTH: [Moment(5.0, {"x": 1.0})]}


class Asked(Lateness):
    """Remembers what it was asked about."""

    def __init__(self) -> None:
        self.asked: list[tuple[float, float]] = []

    def doubt(self, _timing: Timing, since_s: float, end_s: float) -> str:
        self.asked.append((since_s, end_s))
        return "too slow"


@pytest.mark.parametrize(
    ("timing", "asked"),
    [
        (Timing(When.WITHIN, 4.0, 8.0), (3.0, 8.0)),
        (Timing(When.BETWEEN, 4.0, 8.0), (3.0, 5.0)),  # it had failed at 5 s
        (Timing(When.WITHIN, 1.0, 8.0), (0.0, 8.0)),  # nothing had happened before
    ],
)
def test_a_failure_is_in_doubt_since_the_last_thing_that_happened(
    timing: Timing, asked: tuple[float, float]
) -> None:
    lateness = Asked()
    lines = tuple(ScriptStep("", time_s, {}) for time_s in (2.0, 3.0, 6.0))
    expectation = Expectation(Track.TRUTH, "x", NEVER, timing)
    verdict = runner._judge(expectation, lines, OBSERVED, lateness)
    assert (verdict.doubt, lateness.asked) == ("too slow", [asked])


def test_what_is_met_stays_met() -> None:
    lateness = Asked()
    always = Condition("is always so", lambda _: True)
    expectation = Expectation(Track.TRUTH, "x", always, Timing(When.WITHIN, 0.0, 9.0))
    verdict = runner._judge(expectation, (), OBSERVED, lateness)
    assert (verdict.ok, verdict.doubt, lateness.asked) == (True, "", [])


class Starved:
    """A gateway that always waits for a processor."""

    def __init__(self, _pid: int) -> None:
        """Of any process."""

    def take_s(self) -> float:
        return 0.1


class Gateway(GatewayProcess):
    pid = 1


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[SimulatedRobot]:
    robot = SimulatedRobot(tmp_path, virtual_channel=str(tmp_path), speed=None)
    with closing(robot):
        robot.open()
        yield robot


@pytest.mark.parametrize(("fault", "doubted"), [(None, True), ("bus_cut", True), ("cpu_hog", False)])
def test_a_processor_that_a_fault_takes_is_no_excuse(
    fault: str | None, doubted: bool, robot: SimulatedRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner, "Waiting", Starved)
    active = [] if fault is None else [Active(fault, "x", 0.0, None, {})]
    lateness = runner._watch(robot, Gateway(robot.config, robot.config))
    with monkeypatch.context() as meanwhile:
        meanwhile.setattr(type(robot.faults), "active", active)
        robot.exoskeleton.clock.run_until(500 * MILLISECOND_NS)
    assert bool(lateness.doubt(Timing(When.BETWEEN, 0.0, 1.0), 0.0, 1.0)) is doubted


@pytest.mark.parametrize(("armed", "ended"), [(False, signal.SIGTERM), (True, signal.SIGKILL)])
def test_a_gateway_that_has_armed_drives_is_not_asked_whether_it_would_end(
    armed: bool, ended: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    process = GatewayProcess(tmp_path / "robot.toml", tmp_path / "log", armed=armed)
    program = f"import signal; print({gateway._LISTENING.decode()!r} + 'x:1', flush=True); signal.pause()"
    monkeypatch.setattr(process, "_command", [sys.executable, "-c", program])
    with process as address:
        assert address == ("x", 1)
    assert process._process is not None
    assert process._process.returncode == -ended
