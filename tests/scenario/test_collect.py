"""`gwrms collect` against robots: nothing is missing, whatever happens to it, and for however long.

GWRMS_SIMULATED_S=3600 for an hour of the robots' time; GWRMS_SIMULATOR for the simulators' options, such as
"--speed 2" where the computer carries that: a second of three whole robots takes a second of a core.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from gateway.main import main
from tests.scenario.collecting import Collecting, Kept
from tests.scenario.processes import Bench
from tests.support.waiting import WAIT_S, until

FAST_S = (8, int(os.environ.get("GWRMS_SIMULATED_S", "60")))
SIMULATED_S = int(os.environ.get("GWRMS_SIMULATED_S", "10"))
SIMULATOR = tuple(os.environ.get("GWRMS_SIMULATOR", "").split())
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
    """A simulated robot with a gateway, under a name of its own, which tells its time."""

    def __init__(self, folder: Path, processes: ExitStack) -> None:
        folder.mkdir()
        self._truth = folder / "truth.jsonl"
        self.simulator_options = (*SIMULATOR, "--truth", str(self._truth))
        super().__init__(folder, processes)

    def simulated_s(self) -> float:
        """How much time has passed for the robot, which is not ours at another speed."""
        with self._truth.open("rb") as lines:
            columns = json.loads(lines.readline())["columns"]
            lines.seek(-min(lines.seek(0, os.SEEK_END), 8192), os.SEEK_END)
            newest = json.loads(lines.read().splitlines(keepends=True)[-2])
        return float(newest[columns.index("simulated_ns")] / 1e9)

    def start_gateway(self) -> None:
        named = self.config.read_text().replace('name = "simulated-exo"', f'name = "{self.folder.name}"')
        self.config.write_text(named)
        super().start_gateway()


@pytest.fixture
def robots(tmp_path: Path) -> Iterator[dict[str, Robot]]:
    with ExitStack() as processes:
        yield {name: Robot(tmp_path / name, processes) for name in ROBOTS}


@contextmanager
def served(*options: str) -> Iterator[dict[str, str]]:
    """Three robots that cost next to nothing, by name."""
    command = [sys.executable, "-m", "tests.wire_robots", "3", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        ports = json.loads(process.stdout.readline())
        yield {f"exo-{number:02}": f"127.0.0.1:{port}" for number, port in enumerate(ports)}
        process.kill()


@pytest.fixture
def steady_robots() -> Iterator[dict[str, str]]:
    with served("--seconds", "3600") as robots:
        yield robots


def test_a_killed_collector_loses_nothing_that_it_had_and_goes_on(
    steady_robots: dict[str, str], start: Start, capsys: pytest.CaptureFixture[str]
) -> None:
    collecting = start(steady_robots)
    collecting.until_more(100)
    acknowledged = collecting.rows()
    # It commits in the order in which things come; records of other tables are fewer than a hundred.
    until(lambda: collecting.report().recorder.recorded >= sum(acknowledged.values()) + 100)
    collecting.kill()
    collecting.start()
    collecting.until_more(100)
    later = collecting.rows()
    assert main(["collect", "--status", "--config", str(collecting.config)]) == 0
    shown = capsys.readouterr()
    assert all(name in shown.out for name in steady_robots), shown.err
    assert collecting.end() == 0
    for name in steady_robots:
        kept = collecting.kept(name)
        assert len(kept.rows) >= acknowledged[name] + later[name]
        assert len(kept.sessions) == 2  # one a life of the collector
        check_whole(kept)


@pytest.mark.timeout(300 + 10 * SIMULATED_S)
def test_as_long_as_robots_walk_there_is_no_gap(robots: dict[str, Robot], start: Start) -> None:
    collecting = start({name: robot.address for name, robot in robots.items()})
    collecting.until_more(1)
    begun_s = {name: robot.simulated_s() for name, robot in robots.items()}
    until(
        lambda: all(robot.simulated_s() >= begun_s[name] + SIMULATED_S for name, robot in robots.items()),
        collecting.log,
        within_s=WAIT_S + 10 * SIMULATED_S,
    )
    report = collecting.report()
    assert {link.links for link in report.robots.values()} == {1}
    assert (report.recorder.lost, report.recorder.alarms) == (0, ())
    assert collecting.end() == 0
    for name in ROBOTS:
        check_whole(collecting.kept(name))


def check_whole(kept: Kept) -> None:
    """Every row that the robot has made is there, once; where it could not make one in time, it is told."""
    missing = 0
    for rows in kept.connections().values():
        named = [(row["seq"], row["row"]) for row in rows]
        assert len(named) == len(set(named))
        assert {seq for seq, _ in named} == set(range(named[-1][0] + 1))
        missing += (rows[-1]["stamp_ns"] - rows[0]["stamp_ns"]) // PERIOD_NS + 1 - len(rows)
    dropped = sum(json.loads(event["data"])["rows"] for event in kept.events if event["kind"] == "dropped")
    kinds = {event["kind"] for event in kept.events}
    assert kinds <= {"dropped", "shed"}, kept.events  # by the robot, on a computer that is too busy
    assert missing >= dropped if "shed" in kinds else missing == dropped


@pytest.fixture
def fast_robots(seconds: int) -> Iterator[dict[str, str]]:
    """Three robots whose time passes as fast as they are followed."""
    with served("--fast", "--seconds", str(seconds)) as robots:
        yield robots


@pytest.mark.timeout(300 + max(FAST_S))
@pytest.mark.parametrize("seconds", FAST_S)
def test_however_much_comes_at_once_there_is_no_gap(
    fast_robots: dict[str, str], start: Start, seconds: int
) -> None:
    collecting = start(fast_robots)
    expected = dict.fromkeys(fast_robots, 100 * seconds)
    until(lambda: collecting.rows() == expected, collecting.rows, within_s=120 + seconds)
    report = collecting.report()
    assert (report.recorder.lost, report.recorder.alarms) == (0, ())
    assert collecting.end() == 0
    for robot in fast_robots:
        kept = collecting.kept(robot)
        stamps_ns = [row["stamp_ns"] for row in kept.rows]
        assert [stamp_ns - stamps_ns[0] for stamp_ns in stamps_ns] == [
            number * PERIOD_NS for number in range(100 * seconds)
        ]
        assert kept.events == []
