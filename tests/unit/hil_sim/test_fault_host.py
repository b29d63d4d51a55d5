"""Faults of the computer: real programs that take something, and are gone afterwards."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from hil_sim.exoskeleton import Exoskeleton
from hil_sim.faults.fault import FaultRefused
from hil_sim.faults.injector import Faults
from tests.support.waiting import until

MEGABYTE = 1 << 20


@pytest.fixture(scope="module")
def robot() -> Exoskeleton:
    return Exoskeleton()


@pytest.fixture
def faults(robot: Exoskeleton, tmp_path: Path) -> Iterator[Faults]:
    faults = Faults(robot, tmp_path)
    yield faults
    faults.clear()


def hogs() -> list[psutil.Process]:
    found = psutil.Process().children(recursive=True)
    return [one for one in found if "hil_sim.faults.hog" in one.cmdline()]


def started(count: int) -> list[psutil.Process]:
    """So many hogs: Linux tells the words of a program a moment after `Popen` has returned."""
    return until(lambda: found if len(found := hogs()) >= count else None, hogs)


def the_hog() -> psutil.Process:
    (hog,) = started(1)
    return hog


def test_cpu_hog_is_a_process_that_computes_until_it_is_cleared(faults: Faults) -> None:
    faults.begin("cpu_hog", params={"cores": 1})
    hog = the_hog()
    until(lambda: hog.cpu_times().user > 0.2)
    faults.clear()
    assert not hog.is_running()
    assert hogs() == []


def test_cpu_hog_takes_every_core_where_none_is_said(faults: Faults) -> None:
    faults.begin("cpu_hog")
    assert len(started(os.cpu_count() or 1)) == os.cpu_count()
    faults.clear()
    assert hogs() == []


def test_memory_hog_holds_what_was_said_and_gives_it_back(faults: Faults) -> None:
    faults.begin("memory_hog", params={"megabytes": 64})
    hog = the_hog()
    until(lambda: hog.memory_info().rss > 64 * MEGABYTE)
    assert hog.memory_info().rss < 128 * MEGABYTE
    assert Path(f"/proc/{hog.pid}/oom_score_adj").read_text(encoding="ascii").strip() == "1000"
    faults.clear()
    assert not hog.is_running()


def test_memory_hog_refuses_more_than_half_of_what_is_left(faults: Faults) -> None:
    too_much = psutil.virtual_memory().available // MEGABYTE
    with pytest.raises(FaultRefused, match="more than half of what is available here"):
        faults.begin("memory_hog", params={"megabytes": min(too_much, 65_536)})
    assert hogs() == []
    assert faults.active == []


def test_slow_disk_writes_in_its_folder_and_leaves_nothing_behind(faults: Faults, tmp_path: Path) -> None:
    faults.begin("slow_disk", params={"writers": 1, "megabytes": 4, "folder": str(tmp_path)})
    hog = the_hog()
    until(lambda: hog.io_counters().write_chars > 8 * MEGABYTE)  # over and over
    target = next(Path(one).stat() for one in descriptors(hog) if str(tmp_path) in str(Path(one).readlink()))
    assert target.st_size <= 4 * MEGABYTE
    assert list(tmp_path.iterdir()) == []
    faults.clear()
    assert not hog.is_running()


def descriptors(process: psutil.Process) -> list[Path]:
    return list(Path(f"/proc/{process.pid}/fd").iterdir())


def test_slow_disk_refuses_a_folder_that_is_none(faults: Faults, tmp_path: Path) -> None:
    with pytest.raises(FaultRefused, match="is no folder to write in"):
        faults.begin("slow_disk", params={"folder": str(tmp_path / "none")})


def test_programs_end_when_the_simulator_is_killed() -> None:
    """They live by a pipe from the simulator: nothing is left when that is gone."""
    code = (
        "from pathlib import Path; from hil_sim.exoskeleton import Exoskeleton\n"
        "from hil_sim.faults.injector import Faults\n"
        "faults = Faults(Exoskeleton(), Path('.'))\n"
        "faults.begin('cpu_hog', params={'cores': 1})\n"
        "print(flush=True); input()"
    )
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as simulator:
        assert simulator.stdout is not None
        simulator.stdout.readline()
        hog = the_hog()
        simulator.kill()
    until(lambda: not hog.is_running() or hog.status() == psutil.STATUS_ZOMBIE)
