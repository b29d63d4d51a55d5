"""`gwrms collect` against robots: nothing is missing, whatever happens to it, and for however long.

GWRMS_SIMULATED_S=3600 for an hour of the robots' time.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.scenario.collecting import Collecting
from tests.scenario.processes import Bench, gwrms, until

SIMULATED_S = int(os.environ.get("GWRMS_SIMULATED_S", "60"))
ROBOTS = ("exo-a", "exo-b", "exo-c")
PERIOD_NS = 10_000_000

Start = Callable[[dict[str, str]], Collecting]


@pytest.fixture
def start(tmp_path: Path, store_libraries: None) -> Iterator[Start]:
    """A collector of these robots, at work."""
    with ExitStack() as processes:

        def started(robots: dict[str, str]) -> Collecting:
            collecting = Collecting(tmp_path, robots)
            processes.callback(collecting.close)
            collecting.start()
            return collecting

        yield started


class Robot(Bench):
    """A simulated robot with a gateway, under a name of its own."""

    def __init__(self, folder: Path, processes: ExitStack) -> None:
        folder.mkdir()
        super().__init__(folder, processes)

    def start_gateway(self) -> None:
        named = self.config.read_text().replace('name = "simulated-exo"', f'name = "{self.folder.name}"')
        self.config.write_text(named)
        super().start_gateway()


@pytest.fixture
def robots(tmp_path: Path) -> Iterator[dict[str, Robot]]:
    with ExitStack() as processes:
        yield {name: Robot(tmp_path / name, processes) for name in ROBOTS}


@pytest.mark.timeout(300)
def test_a_killed_collector_loses_nothing_that_it_had_and_goes_on(
    robots: dict[str, Robot], start: Start
) -> None:
    collecting = start({name: robot.address for name, robot in robots.items()})
    collecting.until_more(150)
    acknowledged = collecting.rows()
    # It commits in the order in which things come; records of other tables are fewer than a hundred.
    until(lambda: collecting.report().recorder.recorded >= sum(acknowledged.values()) + 100)
    collecting.kill()
    collecting.start()
    collecting.until_more(150)
    later = collecting.rows()
    shown = gwrms("collect", "--status", "--config", str(collecting.config))
    assert all(name in shown.stdout for name in ROBOTS), shown.stderr
    assert collecting.end() == 0
    for name in ROBOTS:
        kept = collecting.kept(name)
        assert len(kept.rows) >= acknowledged[name] + later[name]
        assert len(kept.sessions) == 2  # one a life of the collector
        missing = 0
        for rows in kept.connections().values():
            named = [(row["seq"], row["row"]) for row in rows]
            assert len(named) == len(set(named))
            assert {seq for seq, _ in named} == set(range(named[-1][0] + 1))
            missing += (rows[-1]["stamp_ns"] - rows[0]["stamp_ns"]) // PERIOD_NS + 1 - len(rows)
        told = [json.loads(event["data"])["rows"] for event in kept.events if event["kind"] == "dropped"]
        assert missing == sum(told)  # by the robot, on a computer that is too busy
        assert len(told) == len(kept.events)


@pytest.fixture
def fast_robots() -> Iterator[dict[str, str]]:
    """Three robots whose time passes as fast as they are followed."""
    command = [sys.executable, "-m", "tests.wire_robots", "3", "--fast", "--seconds", str(SIMULATED_S)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as served:
        assert served.stdout is not None
        ports = json.loads(served.stdout.readline())
        yield {f"exo-{number:02}": f"127.0.0.1:{port}" for number, port in enumerate(ports)}
        served.kill()


@pytest.mark.timeout(120 + SIMULATED_S)
def test_for_as_long_as_it_collects_there_is_no_gap(fast_robots: dict[str, str], start: Start) -> None:
    collecting = start(fast_robots)
    expected = dict.fromkeys(fast_robots, 100 * SIMULATED_S)
    until(lambda: collecting.rows() == expected, collecting.rows, within_s=120 + SIMULATED_S)
    report = collecting.report()
    assert (report.recorder.lost, report.recorder.alarms) == (0, ())
    assert collecting.end() == 0
    for robot in fast_robots:
        kept = collecting.kept(robot)
        stamps_ns = [row["stamp_ns"] for row in kept.rows]
        assert [stamp_ns - stamps_ns[0] for stamp_ns in stamps_ns] == [
            number * PERIOD_NS for number in range(100 * SIMULATED_S)
        ]
        assert kept.events == []
