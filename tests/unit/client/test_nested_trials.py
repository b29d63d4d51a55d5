"""Blocks that write within a block on trial: the outermost one keeps the lease, and its trial."""

from pathlib import Path

import pytest

from gateway.client import Robot
from gateway.client.errors import RemoteError
from tests.unit.gateway.conftest import bench  # noqa: F401  # a fixture
from tests.unit.gateway.harness import Bench, config, serving

CYCLE_TIME, STEP_LENGTH = (0x2002, 0), (0x2001, 0)


@pytest.fixture
def robots(bench: Bench, tmp_path: Path) -> Bench:  # noqa: F811
    return bench


def test_a_write_within_a_trial_leaves_the_trial_in_force(robots: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path)) as (host, port), Robot(f"{host}:{port}") as robot:
        with robot.trial({"gait.cycle_time": 1.3}, trial_s=60) as written:
            robot.write({"gait.step_length": 0.45})
            with pytest.raises(RemoteError, match="on trial"):
                robot.write({"gait.cycle_time": 1.4})
            assert [one.write for one in robot.describe().trials] == [written.write]
            assert robots.gait.node.objects[CYCLE_TIME] == (1300).to_bytes(2, "little")
        assert robots.gait.node.objects[CYCLE_TIME] == (1200).to_bytes(2, "little")
        assert robots.gait.node.objects[STEP_LENGTH] == (450).to_bytes(2, "little")


def test_a_trial_within_a_trial_takes_it_over_and_the_outer_block_ends_well(
    robots: Bench, tmp_path: Path
) -> None:
    with serving(config(tmp_path)) as (host, port), Robot(f"{host}:{port}") as robot:
        with robot.trial({"gait.cycle_time": 1.3}, trial_s=60):
            with robot.trial({"gait.cycle_time": 1.4}, trial_s=60) as second:
                assert second.before == {"gait.cycle_time": 1.2}
            assert robots.gait.node.objects[CYCLE_TIME] == (1200).to_bytes(2, "little")
        assert robot.describe().trials == []
