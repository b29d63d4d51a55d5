"""A whole robot of processes."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from gateway.config import load
from hil_sim.robot import SimulatedRobot
from tests.scenario.patience import patient
from tests.scenario.processes import Bench
from tests.support.waiting import until
from tests.unit.gateway.harness import Client, serving

STOP_S = 2.5  # within which a stop is answered, whatever the drives do: no drive is waited for longer


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """Of its own: what is killed, stopped or started."""
    with ExitStack() as processes:
        yield _whole(Patient(tmp_path, processes))


@pytest.fixture(scope="module")
def walking(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """One for all tests of a file that leave it walking as it was."""
    folder = tmp_path_factory.mktemp("walking")
    with ExitStack() as processes:
        patch = processes.enter_context(pytest.MonkeyPatch.context())
        patch.setenv("XDG_STATE_HOME", str(folder / "state"))
        yield _whole(Bench(folder, processes))


@pytest.fixture(scope="module")
def one_robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimulatedRobot]:
    """In this process, walking: one for all tests of a file that leave it as it was."""
    folder = tmp_path_factory.mktemp("robot")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(folder / "state"))
        with SimulatedRobot(folder, virtual_channel=f"one {folder}") as robot:
            yield robot


@pytest.fixture(scope="module")
def one_gateway(one_robot: SimulatedRobot) -> Iterator[tuple[str, int]]:
    """The address of that robot's, here too. One client stays, so that its threads are no test's."""
    with serving(load(one_robot.config)) as address, Client(address) as stays:
        until(lambda: None not in stays.call("component.snapshot")["values"].values(), "all is there")
        stays.call("stream.start", modules=["component"], rate_hz=1, channels=["left_hip.position"])
        stays.call("control.acquire", ttl_s=60)
        stays.call("parameter.write", changes={"gait.step_length": 0.4})
        stays.call("control.release")
        yield address


class Patient(Bench):
    """Its gateway takes no device for silent that a busy computer keeps from answering."""

    def start_gateway(self) -> None:
        patient(self.config, patience_s=STOP_S)
        super().start_gateway()


def _whole(bench: Bench) -> Bench:
    bench.until_whole()
    return bench
