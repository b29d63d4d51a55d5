"""Threads as procfs tells of them, recorded and real; and the control loop's own processes in a snapshot."""

import os
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.config import ConfigError
from gateway.modules.resource.scheduling import Scheduling
from gateway.modules.resource.tasks import Schedule, Spent, Tasks
from tests.support.waiting import until
from tests.unit.gateway.harness import HEAD, ROBOT, Bench, Client, config, serving
from tests.unit.gateway.recorded import Process, Recorded, Thread, single

MS = 1_000_000
SECOND = 1_000 * MS


@pytest.fixture
def recorded(tmp_path: Path) -> Recorded:
    control = Process(
        [
            Thread(40, "python3", 5 * MS, 2 * MS),
            Thread(41, "cycle (1 kHz)", policy=1, rt_priority=80, core=1),
        ],
        cmdline="nice -n -5 /opt/exo/exo_control --hz 100",
        cores="1,3-5",
    )
    made = Recorded(tmp_path / "proc", [control, single(7, "kworker/0:1", nice=-20)])
    made.write()
    (made.root / "meminfo").write_text("")
    return made


@pytest.fixture
def tasks(recorded: Recorded) -> Iterator[Tasks]:
    tasks = Tasks(str(recorded.root))
    yield tasks
    tasks.close()


def test_every_thread_of_every_process_is_met_once(tasks: Tasks, recorded: Recorded) -> None:
    assert tasks.meet() == [(7, 7), (40, 40), (40, 41)]
    assert tasks.meet() == []
    assert tasks.look() == {(7, 7): Spent(0, 0), (40, 40): Spent(5 * MS, 2 * MS), (40, 41): Spent(0, 0)}
    recorded.processes.append(single(50, "new"))
    recorded.write()
    assert tasks.meet() == [(50, 50)]
    assert tasks.threads(40) == [40, 41]


def test_processes_are_found_by_name_or_by_the_program_they_run(tasks: Tasks) -> None:
    tasks.meet()
    assert tasks.named(["exo_*"]) == {40: "python3"}
    assert tasks.named(["kworker/*"]) == {7: "kworker/0:1"}
    assert tasks.named(["python3", "kworker*"]) == {40: "python3", 7: "kworker/0:1"}
    assert tasks.named(["--hz", "100"]) == {}


def test_how_a_thread_is_scheduled(tasks: Tasks) -> None:
    tasks.meet()
    assert tasks.schedule((40, 41)) == Schedule("fifo", 80, 1, SECOND)
    assert tasks.schedule((7, 7)) == Schedule("other", -20, 0, SECOND)
    assert tasks.schedule((8, 8)) is None
    assert (tasks.cores(40), tasks.cores(7), tasks.cores(8)) == ({1, 3, 4, 5}, {0, 1}, set())


@pytest.fixture
def real() -> Iterator[Tasks]:
    tasks = Tasks()
    yield tasks
    tasks.close()


def test_real_threads_run_and_their_ends_are_noticed(real: Tasks) -> None:
    ended = threading.Event()
    thread = threading.Thread(target=ended.wait)
    thread.start()
    try:
        real.meet()
        me, other = (os.getpid(), os.getpid()), (os.getpid(), thread.native_id or 0)
        before = real.look()
        while real.look()[me].ran_ns < before[me].ran_ns + MS:
            pass
        assert other in before
        assert os.getpid() in real.named([real.name(os.getpid())])
    finally:
        ended.set()
        thread.join()
    kernels = Path(f"/proc/self/task/{thread.native_id}")
    until(lambda: not kernels.exists(), "the thread's end")  # Python's is told before the kernel's
    assert other not in real.look()
    real.meet()
    assert thread.native_id not in real.threads(os.getpid())


def test_a_control_process_and_its_threads_since_the_last_look(recorded: Recorded) -> None:
    control = recorded.processes[0]
    scheduling = Scheduling(["exo_control"], str(recorded.root))
    (first,) = scheduling.look(SECOND)
    assert (first.minor_faults_per_s, first.read_bytes_per_s, first.threads[0].cpu_percent) == (
        None,
        None,
        None,
    )
    main, cycle = control.threads
    main.ran_ns += 100 * MS
    cycle.ran_ns += 500 * MS
    cycle.waited_ns += 250 * MS
    cycle.voluntary, cycle.forced = 200, 6
    control.faults = (40, 2)
    recorded.write()
    (process,) = scheduling.look(3 * SECOND)
    assert (process.pid, process.name) == (40, "python3")
    assert (process.minor_faults_per_s, process.major_faults_per_s) == (20, 1)
    assert process.read_bytes_per_s is None  # hidden
    assert [one.cpu_percent for one in process.threads] == [5, 25]
    one = process.threads[1]
    assert (one.name, one.policy, one.priority, one.core) == ("cycle (1 kHz)", "fifo", 80, 1)
    assert (one.wait_percent, one.switches_per_s, one.forced_switches_per_s) == (12.5, 100, 3)


def test_disks_are_told_where_the_owner_lets_us(recorded: Recorded) -> None:
    scheduling = Scheduling(["exo_control"], str(recorded.root))
    recorded.processes[0].disk = (4096, 100)
    recorded.write()
    scheduling.look(SECOND)
    recorded.processes[0].disk = (8192, 300)
    recorded.write()
    (process,) = scheduling.look(2 * SECOND)
    assert (process.read_bytes_per_s, process.write_bytes_per_s) == (4096, 200)


# In the gateway


def test_a_snapshot_tells_of_the_control_loop_only_when_asked(bench: Bench, tmp_path: Path) -> None:
    robot = config(tmp_path, ROBOT + f'[control_loop]\nprocesses = ["{_own_name()}"]\n')
    with serving(robot) as address, Client(address) as client:
        assert "control" not in client.call("resource.snapshot")
        for _ in range(2):
            answer = client.call("resource.snapshot", include=["control"], processes=False)
        (process,) = [one for one in answer["control"] if one["pid"] == os.getpid()]
        assert len(process["threads"]) >= 2  # this test's, and the daemon's
        assert sum(one["cpu_percent"] for one in process["threads"]) > 0


def _own_name() -> str:
    return Path("/proc/self/comm").read_text().strip()


def test_without_names_there_is_nothing_to_tell(client: Client) -> None:
    refusal = client.refused("resource.snapshot", include=["control"])
    assert (refusal.kind, "[control_loop]" in str(refusal)) == ("bad_params", True)


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ("processes = []", "processes"),
        ('processes = ["a"]\nbus = "other"\nperiod_ms = 10', "there is no bus 'other': .*main"),
        ('processes = ["a"]\nbus = "main"', "bus and period_ms belong together"),
        ('processes = ["a"]\nperiod_ms = 10', "bus and period_ms belong together"),
        ('processes = ["a"]\nbus = "main"\nperiod_ms = 0', "period_ms"),
        ("period_ms = 10", "processes: is missing"),
    ],
)
def test_a_table_that_cannot_work_is_refused(tmp_path: Path, table: str, says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        config(tmp_path, f"{HEAD}[control_loop]\n{table}\n")
