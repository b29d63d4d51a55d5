"""The host's own resources: percentages since the same asker's last look, orders, limits, secrets."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest

from gateway.modules.resource import extras, host
from gateway.modules.resource.counters import CoreTimes, ProcessTimes
from gateway.modules.resource.host import Meter
from gateway.modules.resource.module import ResourceModule
from gateway.modules.resource.redact import redact
from gateway.process.loop import Loop
from gateway.registry import Context
from gateway.wire.resource import MemoryUse, ProcessUse, ResourceSnapshot, ResourceSnapshotParams
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import HEAD, Client, config

MB = 1 << 20


class Fake:
    """Counters and a clock, set by hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_ns = 10**12
        self.table: list[ProcessTimes] = []
        self.each: list[CoreTimes] = [CoreTimes(10.0, 100.0), CoreTimes(0.0, 100.0)]
        monkeypatch.setattr(time, "monotonic_ns", lambda: self.now_ns)

    def processes(self) -> list[ProcessTimes]:
        return self.table

    def cores(self) -> list[CoreTimes]:
        return self.each

    def memory(self) -> MemoryUse:
        return MemoryUse(8 * MB, 6 * MB, 2 * MB, 0)

    def own_rss_bytes(self) -> int:
        return MB

    def command_line(self, pid: int) -> list[str]:
        return ["motion", "--token", str(pid)]

    def close(self) -> None:
        """Nothing is held."""


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> Fake:
    return Fake(monkeypatch)


def motion(cpu_s: float) -> ProcessTimes:
    return ProcessTimes(7, "motion", cpu_s, MB)


def test_percentages_are_since_the_last_look_and_unknown_at_first(fake: Fake) -> None:
    meter = Meter(fake)
    fake.table = [ProcessTimes(1, "init", 100.0, MB), motion(3.0)]
    first = meter.snapshot(ResourceSnapshotParams())
    assert (first.cpu.percent, first.cpu.per_core) == (None, [None, None])
    assert isinstance(first.processes, list)
    assert [row.cpu_percent for row in first.processes] == [None, None]
    assert first.gateway.cpu_percent is None
    fake.now_ns += 2 * 10**9
    fake.each = [CoreTimes(11.0, 102.0), CoreTimes(0.5, 102.0)]
    fake.table[1].cpu_s = 6.0
    second = meter.snapshot(ResourceSnapshotParams())
    assert (second.cpu.percent, second.cpu.per_core) == (37.5, [50.0, 25.0])
    assert isinstance(second.processes, list)
    assert [(row.pid, row.cpu_percent) for row in second.processes] == [(7, 150.0), (1, 0.0)]


def test_a_new_process_with_an_old_pid_is_unknown_at_first(fake: Fake) -> None:
    meter = Meter(fake)
    fake.table = [motion(500.0)]
    meter.snapshot(ResourceSnapshotParams())
    fake.now_ns += 10**9
    fake.table = [motion(500.0)]
    table = meter.snapshot(ResourceSnapshotParams()).processes
    assert isinstance(table, list)
    assert [row.cpu_percent for row in table] == [None]


def test_a_look_without_processes_does_not_spoil_the_next_with_them(fake: Fake) -> None:
    meter = Meter(fake)
    fake.table = [motion(0.0)]
    meter.snapshot(ResourceSnapshotParams())
    fake.now_ns += 10**9
    meter.snapshot(ResourceSnapshotParams(processes=False))
    fake.now_ns += 10**9
    fake.table[0].cpu_s = 1.0
    table = meter.snapshot(ResourceSnapshotParams()).processes
    assert isinstance(table, list)
    assert [row.cpu_percent for row in table] == [50.0]


def test_two_looks_in_one_instant_give_no_rate(fake: Fake) -> None:
    meter = Meter(fake)
    fake.table = [motion(0.0)]
    meter.snapshot(ResourceSnapshotParams())
    fake.table[0].cpu_s = 1.0
    table = meter.snapshot(ResourceSnapshotParams()).processes
    assert isinstance(table, list)
    assert [row.cpu_percent for row in table] == [None]


def test_a_command_line_comes_without_its_secrets(fake: Fake) -> None:
    fake.table = [motion(0.0)]
    table = Meter(fake).snapshot(ResourceSnapshotParams(include=["cmdline"])).processes
    assert isinstance(table, list)
    assert [row.cmdline for row in table] == ["motion --token ***"]


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


def test_a_first_look_begins_with_programs_and_not_with_threads_of_the_kernel() -> None:
    rows = [
        ProcessUse(2, "kthreadd", None, 0),
        ProcessUse(1, "init", None, 20),
        ProcessUse(9, "gwrms", None, 30),
    ]
    assert [row.pid for row in host._sorted(rows, ResourceSnapshotParams())] == [9, 1, 2]
    lowest_first = ResourceSnapshotParams(descending=False)
    assert [row.pid for row in host._sorted(rows, lowest_first)] == [2, 1, 9]


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        (["server", "--port", "80"], "server --port 80"),
        (["server", "--password", "hunter2", "-v"], "server --password *** -v"),
        (["server", "--api-token=abc"], "server --api-token=***"),
        (["MYSQL_PASSWORD=abc", "run"], "MYSQL_PASSWORD=*** run"),
        (["fetch", "https://user:pw@example.org/x"], "fetch https://***@example.org/x"),
        (["fetch", "https://example.org/x"], "fetch https://example.org/x"),
        (
            ["fetch", "https://example.org/x?access_token=ab&n=1"],
            "fetch https://example.org/x?access_token=***",
        ),
        (["fetch", "-u", "user:pw"], "fetch -u user:***"),
        (["python", "-u", "motion.py"], "python -u motion.py"),
        (["fetch", "-H", "Authorization: Bearer abc"], "fetch -H Authorization: Bearer ***"),
        (["fetch", "-H", "Authorization: Basic abc"], "fetch -H Authorization: Basic ***"),
        (["server", "--passphrase", "two words", "-v"], "server --passphrase *** -v"),
        (["server", "--passphrase=two words", "-v"], "server --passphrase=*** -v"),
        (["sh", "-c", "server --password hunter2 -v"], "sh -c server --password *** -v"),
        (["sh", "-c", "PGPASSWORD=hunter2 psql -h db"], "sh -c PGPASSWORD=***"),
        (["server --private-key abc"], "server --private-key ***"),
        (["ftp", "--passive", "host"], "ftp --passive host"),
        (["git", "log", "--author", "me"], "git log --author me"),
        (["sshpass", "-p", "hunter2", "ssh", "-p", "22", "host"], "sshpass -p *** ssh -p 22 host"),
        (["/usr/bin/sshpass", "-phunter2", "ssh"], "/usr/bin/sshpass -p*** ssh"),
        (["sh", "-c", "sshpass -p 'two words' ssh host"], "sh -c sshpass -p *** ssh host"),
        (["mysql", "-u", "root", "-phunter2", "db"], "mysql -u root -p*** db"),
        (["mysql", "-p", "db"], "mysql -p db"),
        (["sh", "-c", "mysqldump -phunter2 db"], "sh -c mysqldump -p*** db"),
        (["wpa_cli", "psk=hunter2"], "wpa_cli psk=***"),
        (["nmcli", "con", "wifi-sec.psk", "hunter2"], "nmcli con wifi-sec.psk ***"),
        (["nmcli", "--psk", "hunter2"], "nmcli --psk ***"),
        (["sh", "-c", "wpa psk=hunter2 ssid=lab"], "sh -c wpa psk=*** ssid=lab"),
        (["fetch", "ftp://user:p/w@host/x"], "fetch ftp://***@host/x"),
        (["fetch", "postgresql+psycopg://u:p@w@db/x"], "fetch postgresql+psycopg://***@db/x"),
        (["fetch", "https://example.org/a@b"], "fetch https://example.org/a@b"),
        (["env", "KEY=hunter2", "run"], "env KEY=*** run"),
        (["env", "SIGNING_KEY=two words", "run"], "env SIGNING_KEY=*** run"),
        (["sh", "-c", "run KEY=hunter2 -v"], "sh -c run KEY=*** -v"),
        (["setxkbmap", "KEYBOARD=us"], "setxkbmap KEYBOARD=us"),
        (["sort", "--key=2"], "sort --key=2"),
        (["curl", "--user=ada:hunter2"], "curl --user=ada:***"),
        (["redis-cli", "-a", "hunter2"], "redis-cli -a ***"),
        ([], ""),
    ],
)
def test_command_lines_lose_their_secrets(words: list[str], shown: str) -> None:
    assert redact(words) == shown


@pytest.mark.parametrize(
    "unit",
    [
        "a",
        "pass",
        "pass ",
        "a:",
        "://",
        "a://",
        "pass=",
        "pass'",
        "basic ",
        "-p ",
        "KEY_",
        "A_",
        " ",
        "@",
        "a://b:@",
    ],
)
@pytest.mark.parametrize("before", ["", "mysql -p", "sshpass -p ", "pass=", "a://b:"])
def test_a_command_line_is_redacted_in_a_time_that_grows_as_it_does(before: str, unit: str) -> None:
    def took_s(length: int) -> float:
        words = [before + unit * (length // len(unit))]
        times = []
        for _ in range(5):
            began_s = time.thread_time()
            redact(words)
            times.append(time.thread_time() - began_s)
        return min(times)

    short_s, long_s = took_s(4_000), took_s(32_000)
    assert long_s < 8 * 3.5 * max(short_s, 5e-5)  # 8 times the length; squared it would be 64


def test_a_snapshot_over_the_wire_is_of_this_machine(client: Client) -> None:
    answer = client.call("resource.snapshot")
    assert set(answer) == {"stamp_ns", "cpu", "memory", "processes", "gateway"}
    assert answer["memory"]["total"] == psutil.virtual_memory().total
    assert len(answer["cpu"]["per_core"]) == psutil.cpu_count()
    assert len(answer["cpu"]["load"]) == 3
    ours = next(row for row in answer["processes"] if row["pid"] == os.getpid())
    assert set(ours) == {"pid", "name", "cpu_percent", "memory_bytes"}
    assert psutil.Process().name().startswith(ours["name"])
    assert ours["memory_bytes"] > MB


def test_more_comes_only_when_it_is_named(client: Client) -> None:
    everything = ["disk", "network", "thermal", "kernel", "cmdline"]
    answer = client.call("resource.snapshot", include=everything, limit=1, sort="pid")
    assert {"disk", "network", "thermal", "throttling", "kernel"} <= set(answer)
    assert answer["kernel"]["system"] == os.uname().sysname
    assert answer["kernel"]["monotonic_resolution_ns"] > 0
    assert "cmdline" in answer["processes"][0]
    assert "processes" not in client.call("resource.snapshot", processes=False)


def test_every_connection_has_its_own_last_request(connect: Callable[[], Client]) -> None:
    first, second = connect(), connect()
    first.call("resource.snapshot")
    until(lambda: first.call("resource.snapshot")["gateway"]["cpu_percent"] is not None)
    assert second.call("resource.snapshot")["gateway"]["cpu_percent"] is None


def percent(client: Client, pid: int) -> float | None:
    rows = client.call("resource.snapshot")["processes"]
    found: float | None = next((row["cpu_percent"] for row in rows if row["pid"] == pid), None)
    return found


def test_a_busy_process_is_seen_busy(client: Client) -> None:
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as busy:
        try:
            until(lambda: (percent(client, busy.pid) or 0) > 0, "it is seen to compute")
        finally:
            busy.kill()


def test_unknown_words_are_refused(client: Client) -> None:
    assert "gpu" in str(client.refused("resource.snapshot", include=["gpu"]))
    assert client.refused("resource.snapshot", sort="size").kind == "bad_params"
    assert client.refused("resource.snapshot", limit=-1).kind == "bad_params"


def test_throttling_is_read_where_the_system_tells(tmp_path: Path) -> None:
    nothing = extras.throttling(tmp_path)
    assert (nothing.events, nothing.cooling, nothing.frequency) == (None, {}, [])
    for name, text in {
        "devices/system/cpu/cpu0/thermal_throttle/core_throttle_count": "3",
        "devices/system/cpu/cpu1/thermal_throttle/core_throttle_count": "4",
        "devices/system/cpu/cpufreq/policy0/scaling_cur_freq": "900000",
        "devices/system/cpu/cpufreq/policy0/cpuinfo_max_freq": "1800000",
        "devices/system/cpu/cpufreq/policy4/scaling_cur_freq": "<unknown>",
        "devices/system/cpu/cpufreq/policy4/cpuinfo_max_freq": "1800000",
        "class/thermal/cooling_device0/type": "cpufreq-cpu0",
        "class/thermal/cooling_device0/cur_state": "1",
        "class/thermal/cooling_device0/max_state": "4",
        "class/thermal/cooling_device1/type": "pwm-fan",
        "class/thermal/cooling_device1/cur_state": "1",
        "class/thermal/cooling_device1/max_state": "1",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f"{text}\n", encoding="ascii")
    found = extras.throttling(tmp_path)
    assert (found.events, found.cooling, found.frequency) == (7, {"cpufreq-cpu0.0": 0.25}, [0.5, None])


def test_kernel_and_clock_facts(tmp_path: Path) -> None:
    assert extras.kernel(tmp_path).clocksource is None
    for name, text in {
        "kernel/realtime": "1",
        "devices/system/clocksource/clocksource0/current_clocksource": "tsc",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text(f"{text}\n", encoding="ascii")
    facts = extras.kernel(tmp_path)
    assert (facts.preempt_rt, facts.clocksource) == (True, "tsc")
    assert facts.utc_synchronised in (True, False)


def test_nobody_waits_while_somebody_s_table_is_made(
    connect: Callable[[], Client], monkeypatch: pytest.MonkeyPatch
) -> None:
    asker, other = connect(), connect()
    looking, seen = threading.Event(), threading.Event()
    look = Meter.snapshot

    def slow(meter: Meter, params: ResourceSnapshotParams) -> ResourceSnapshot:
        looking.set()
        assert seen.wait(WAIT_S)
        return look(meter, params)

    monkeypatch.setattr(Meter, "snapshot", slow)
    for method in ("resource.snapshot", "status.snapshot"):
        asked = asker.request(method)
        assert looking.wait(WAIT_S)
        assert other.call("clock.read")
        seen.set()
        assert asker.answer(asked)
        looking.clear()
        seen.clear()


def test_nothing_is_measured_or_kept_for_who_has_gone(tmp_path: Path) -> None:
    loop = Loop()
    module = ResourceModule(Context(config(tmp_path, HEAD), loop, {}, lambda _on: None))
    module.start()
    gone: Any = type("Gone", (), {"closed": True, "address": "here"})()
    measured = module.measure(gone, "status.snapshot")
    loop.post(loop.stop)
    loop.run()
    module.stop()
    loop.close()
    assert not measured.done()
    assert module._meters == {}


def test_one_asker_s_looks_are_taken_one_after_the_other(client: Client) -> None:
    asked = [client.request("resource.snapshot", processes=False) for _ in range(50)]
    stamps = [client.answer(one)["stamp_ns"] for one in asked]
    assert stamps == sorted(stamps)
