"""The host's own resources: percentages since the same asker's last look, orders, limits, secrets."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import psutil
import pytest

from gateway.messages import ProcessUse, ResourceSnapshotParams
from gateway.modules import host
from gateway.modules.host import CpuTimes, Host, ProcessTimes, redact
from tests.unit.gateway.harness import Client

MB = 1 << 20


class FakeClock:
    """What the meter reads, a second at a time."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_ns = 10**12
        self.processes: list[ProcessTimes] = []
        self.cores: list[CpuTimes] = [CpuTimes(10.0, 100.0), CpuTimes(0.0, 100.0)]
        monkeypatch.setattr(time, "monotonic_ns", lambda: self.now_ns)
        monkeypatch.setattr(host, "scan_processes", lambda: list(self.processes))
        monkeypatch.setattr(host, "core_times", lambda: list(self.cores))


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeClock:
    return FakeClock(monkeypatch)


def test_percentages_are_since_the_last_look_and_unknown_at_first(fake: FakeClock) -> None:
    meter = Host().meter()
    fake.processes = [ProcessTimes(1, 5.0, "init", 100.0, MB), ProcessTimes(7, 6.0, "motion", 3.0, MB)]
    first = meter.snapshot(ResourceSnapshotParams())
    assert (first.cpu.percent, first.cpu.per_core) == (None, [None, None])
    assert isinstance(first.processes, list)
    assert [row.cpu_percent for row in first.processes] == [None, None]
    assert first.gateway.cpu_percent is None
    fake.now_ns += 2 * 10**9
    fake.cores = [CpuTimes(11.0, 102.0), CpuTimes(0.5, 102.0)]
    fake.processes = [ProcessTimes(1, 5.0, "init", 100.0, MB), ProcessTimes(7, 6.0, "motion", 6.0, MB)]
    second = meter.snapshot(ResourceSnapshotParams())
    assert (second.cpu.percent, second.cpu.per_core) == (37.5, [50.0, 25.0])
    assert isinstance(second.processes, list)
    assert [(row.pid, row.cpu_percent) for row in second.processes] == [(7, 150.0), (1, 0.0)]


def test_a_new_process_with_an_old_pid_is_unknown_at_first(fake: FakeClock) -> None:
    meter = Host().meter()
    fake.processes = [ProcessTimes(7, 6.0, "old", 500.0, MB)]
    meter.snapshot(ResourceSnapshotParams())
    fake.now_ns += 10**9
    fake.processes = [ProcessTimes(7, 99.0, "new", 1.0, MB)]
    table = meter.snapshot(ResourceSnapshotParams()).processes
    assert isinstance(table, list)
    assert [row.cpu_percent for row in table] == [None]


def test_a_look_without_processes_does_not_spoil_the_next_with_them(fake: FakeClock) -> None:
    meter = Host().meter()
    fake.processes = [ProcessTimes(7, 6.0, "motion", 0.0, MB)]
    meter.snapshot(ResourceSnapshotParams())
    fake.now_ns += 10**9
    meter.snapshot(ResourceSnapshotParams(processes=False))
    fake.now_ns += 10**9
    fake.processes = [ProcessTimes(7, 6.0, "motion", 1.0, MB)]
    table = meter.snapshot(ResourceSnapshotParams()).processes
    assert isinstance(table, list)
    assert [row.cpu_percent for row in table] == [50.0]


@pytest.mark.parametrize(
    ("params", "pids"),
    [
        ({}, [2, 1, 3]),
        ({"sort": "cpu", "descending": False}, [3, 1, 2]),
        ({"sort": "memory"}, [3, 1, 2]),
        ({"sort": "name"}, [1, 3, 2]),
        ({"sort": "pid", "descending": True}, [3, 2, 1]),
        ({"sort": "memory", "limit": 1}, [3]),
        ({"limit": 0}, []),
    ],
)
def test_orders_and_limits(params: dict[str, Any], pids: list[int]) -> None:
    rows = [
        ProcessUse(1, "Alpha", 10.0, 20),
        ProcessUse(2, "gamma", 90.0, 10),
        ProcessUse(3, "beta", None, 30),
    ]
    wanted = ResourceSnapshotParams(**params)
    assert [row.pid for row in host._sorted(rows, wanted)[: wanted.limit]] == pids


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (["server", "--port", "80"], "server --port 80"),
        (["server", "--password", "hunter2", "-v"], "server --password *** -v"),
        (["server", "--api-token=abc"], "server --api-token=***"),
        (["MYSQL_PASSWORD=abc", "run"], "MYSQL_PASSWORD=*** run"),
        (["fetch", "https://user:pw@example.org/x"], "fetch https://***@example.org/x"),
        (["fetch", "https://example.org/x"], "fetch https://example.org/x"),
        ([], ""),
    ],
)
def test_command_lines_lose_their_secrets(words: list[str], shown: str) -> None:
    assert redact(words) == shown


def test_a_snapshot_over_the_wire_is_of_this_machine(client: Client) -> None:
    answer = client.call("resource.snapshot")
    assert set(answer) == {"stamp_ns", "cpu", "memory", "processes", "gateway"}
    assert answer["memory"]["total"] == psutil.virtual_memory().total
    assert len(answer["cpu"]["per_core"]) == psutil.cpu_count()
    assert len(answer["cpu"]["load"]) == 3
    ours = next(row for row in answer["processes"] if row["pid"] == os.getpid())
    assert set(ours) == {"pid", "name", "cpu_percent", "memory_bytes"}
    assert ours["name"] == psutil.Process().name()
    assert ours["memory_bytes"] > MB


def test_more_comes_only_when_it_is_named(client: Client) -> None:
    everything = ["disk", "network", "thermal", "kernel", "cmdline"]
    answer = client.call("resource.snapshot", include=everything, limit=1, sort="pid")
    assert {"disk", "network", "thermal", "kernel"} <= set(answer)
    assert answer["kernel"]["system"] == os.uname().sysname
    assert "cmdline" in answer["processes"][0]
    assert "processes" not in client.call("resource.snapshot", processes=False)


def test_every_connection_has_its_own_last_request(connect: Callable[[], Client]) -> None:
    first, second = connect(), connect()
    first.call("resource.snapshot")
    time.sleep(0.1)
    assert first.call("resource.snapshot")["gateway"]["cpu_percent"] is not None
    assert second.call("resource.snapshot")["gateway"]["cpu_percent"] is None


def test_a_busy_process_is_seen_busy(client: Client) -> None:
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as busy:
        try:
            client.call("resource.snapshot")
            time.sleep(1.0)
            rows = client.call("resource.snapshot")["processes"]
        finally:
            busy.kill()
    percent = next(row["cpu_percent"] for row in rows if row["pid"] == busy.pid)
    assert percent > 0


def test_unknown_words_are_refused(client: Client) -> None:
    assert "gpu" in str(client.refused("resource.snapshot", include=["gpu"]))
    assert client.refused("resource.snapshot", sort="size").kind == "bad_params"
    assert client.refused("resource.snapshot", limit=-1).kind == "bad_params"
