"""Linux's counters: the same answer as psutil's, and processes that end, hide or are too many."""

import errno
import fcntl
import functools
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

from gateway.modules.resource.counters import Counters, ProcessTimes
from gateway.modules.resource.host import Meter
from gateway.modules.resource.portable import Portable
from gateway.modules.resource.procfs import SELECTABLE, Procfs
from gateway.wire.messages import ResourceSnapshotParams
from tests.unit.gateway.harness import Client, until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="procfs is Linux's")

MB = 1 << 20
limits = functools.partial(resource.getrlimit, resource.RLIMIT_NOFILE)
TICK_S = 1 / os.sysconf("SC_CLK_TCK")
PAGE = os.sysconf("SC_PAGE_SIZE")
SLEEP = [sys.executable, "-S", "-c", "held = bytearray(b'x' * (32 << 20)); print(flush=True); input()"]


def kept_lines() -> list[str]:
    """The processes' lines that this process holds open."""
    targets = map(target, Path("/proc/self/fd").iterdir())
    return [one for one in targets if one.endswith("/stat") and one != "/proc/stat"]


def target(entry: Path) -> str:
    try:
        return str(entry.readlink())
    except OSError:  # what listed them
        return ""


@pytest.fixture
def procfs() -> Iterator[Procfs]:
    made = Procfs()
    yield made
    made.close()
    assert kept_lines() == []


@pytest.fixture
def child() -> Iterator["subprocess.Popen[str]"]:
    """A process that holds 32 MB and does nothing."""
    pipe = subprocess.PIPE
    with subprocess.Popen(SLEEP, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()
        yield process
        process.kill()


def by_pid(counters: Counters) -> dict[int, ProcessTimes]:
    return {one.pid: one for one in counters.processes()}


class Fake:
    """A procfs of files."""

    def __init__(self, root: Path) -> None:
        self.root = root
        (root / "self").mkdir()
        (root / "self" / "statm").write_text("100 25 10 1 0 50 0\n", encoding="ascii")
        (root / "stat").write_bytes(
            b"cpu  30 2 20 140 10 5 3 0 4 0\n"
            b"cpu0 10 1 10 70 5 2 2 0 4 0\ncpu1 20 1 10 70 5 3 1 0 0 0\nintr 99 1 2\nctxt 5\n"
        )
        (root / "meminfo").write_bytes(
            b"MemTotal:        1000 kB\nMemFree:          100 kB\nMemAvailable:     600 kB\n"
            b"SwapCached:         1 kB\nSwapTotal:        50 kB\nSwapFree:         20 kB\n"
        )

    def process(self, pid: int, name: bytes, user: int = 0, started: int = 500, pages: int = 7) -> None:
        (self.root / str(pid)).mkdir(exist_ok=True)
        fields = ["S", *["1"] * 10, str(user), "3", *["0"] * 4, "1", "0", str(started), "999999", str(pages)]
        line = b"%d (%b) %b 0 0\n" % (pid, name, " ".join(fields).encode())
        (self.root / str(pid) / "stat").write_bytes(line)

    def end(self, pid: int) -> None:
        (self.root / str(pid) / "stat").unlink()
        (self.root / str(pid)).rmdir()


@pytest.fixture
def fake(tmp_path: Path) -> Fake:
    return Fake(tmp_path)


@pytest.fixture
def open_fake(fake: Fake) -> Iterator[Callable[[], Procfs]]:
    """Another `Procfs` of the fake files, at every call."""
    made: list[Procfs] = []

    def make() -> Procfs:
        made.append(Procfs(str(fake.root)))
        return made[-1]

    yield make
    for one in made:
        one.close()


class TestParsing:
    @pytest.mark.parametrize(
        ("raw", "name"),
        [
            (b"motion", "motion"),
            (b"a b (c) d", "a b (c) d"),
            (b"1 (x) R 2", "1 (x) R 2"),
            (b") S 1", ") S 1"),
            (b"new\nline", "new\nline"),
            (b"", ""),
            ("Geh\u00e4use".encode(), "Geh\u00e4use"),
            (b"cut\xc3", "cut\ufffd"),
        ],
    )
    def test_any_name(self, fake: Fake, open_fake: Callable[[], Procfs], raw: bytes, name: str) -> None:
        fake.process(7, raw, user=200, pages=25)
        (seen,) = open_fake().processes()
        assert (seen.pid, seen.name, seen.memory_bytes) == (7, name, 25 * PAGE)
        assert seen.cpu_s == pytest.approx(203 * TICK_S)

    def test_cores_and_memory(self, open_fake: Callable[[], Procfs]) -> None:
        procfs = open_fake()
        assert [tuple(core) for core in procfs.cores()] == [
            pytest.approx((25 * TICK_S, 100 * TICK_S)),
            pytest.approx((35 * TICK_S, 110 * TICK_S)),
        ]
        memory = procfs.memory()
        assert (memory.total, memory.available) == (1000 << 10, 600 << 10)
        assert (memory.used, memory.swap_used) == (400 << 10, 30 << 10)
        assert procfs.own_rss_bytes() == 25 * PAGE

    def test_command_lines_are_words_and_bounded(self, fake: Fake, open_fake: Callable[[], Procfs]) -> None:
        fake.process(7, b"motion")
        path = fake.root / "7" / "cmdline"
        path.write_bytes(b"motion\0--gain\0\xff 2\0")
        assert open_fake().command_line(7) == ["motion", "--gain", "\ufffd 2"]
        path.write_bytes(b"x" * 1_000_000)
        assert len(open_fake().command_line(7)[0]) < 10_000
        path.write_bytes(b"")
        assert open_fake().command_line(7) == []
        assert open_fake().command_line(8) == []


class TestAgainstPsutil:
    def test_the_same_processes(self, procfs: Procfs, child: "subprocess.Popen[str]") -> None:
        portable = Portable()

        def same() -> bool:
            before, through, after = (by_pid(one).keys() for one in (portable, procfs, portable))
            return before & after <= through <= before | after

        until(same, "both see the same processes, kernel threads and all")
        for pid in (child.pid, os.getpid(), 1):
            ours, theirs = by_pid(procfs)[pid], by_pid(portable)[pid]
            assert theirs.name.startswith(ours.name)
            assert ours.memory_bytes == pytest.approx(theirs.memory_bytes, rel=0.1, abs=2 * MB)
        assert by_pid(procfs)[child.pid].memory_bytes > 32 * MB
        assert by_pid(procfs)[child.pid].cpu_s == pytest.approx(by_pid(portable)[child.pid].cpu_s)

    def test_the_same_cores_and_memory(self, procfs: Procfs) -> None:
        portable = Portable()
        before, through, after = portable.cores(), procfs.cores(), portable.cores()
        for first, ours, last in zip(before, through, after, strict=True):
            assert first.total_s - TICK_S <= ours.total_s <= last.total_s + TICK_S
            assert first.busy_s - 0.5 <= ours.busy_s <= last.busy_s + 0.5  # idle time may step back a little
        ours_now, theirs_now = procfs.memory(), portable.memory()
        assert ours_now.total == theirs_now.total
        assert ours_now.used == pytest.approx(theirs_now.used, rel=0.25)
        assert ours_now.swap_used == pytest.approx(theirs_now.swap_used, rel=0.25, abs=16 * MB)
        assert procfs.own_rss_bytes() == pytest.approx(portable.own_rss_bytes(), rel=0.1)

    @pytest.mark.parametrize("make", [Procfs, Portable])
    def test_either_gives_a_whole_snapshot(
        self, make: Callable[[], Counters], child: "subprocess.Popen[str]"
    ) -> None:
        counters = make()
        meter = Meter(counters)
        meter.snapshot(ResourceSnapshotParams())
        table = meter.snapshot(ResourceSnapshotParams(include=["cmdline"])).processes
        counters.close()
        assert isinstance(table, list)
        (row,) = (row for row in table if row.pid == child.pid)
        assert row.cpu_percent == 0.0
        assert row.cmdline == " ".join(SLEEP)

    @pytest.mark.parametrize("make", [Procfs, Portable])
    def test_a_process_stays_the_same_object_while_it_lives(
        self, make: Callable[[], Counters], child: "subprocess.Popen[str]"
    ) -> None:
        counters = make()
        first, second = by_pid(counters), by_pid(counters)
        counters.close()
        assert first[child.pid] is second[child.pid]


class TestEnding:
    def test_one_that_has_ended_is_left_out_and_let_go(
        self, procfs: Procfs, child: "subprocess.Popen[str]"
    ) -> None:
        assert child.pid in by_pid(procfs)
        child.kill()
        child.wait()
        assert child.pid not in by_pid(procfs)
        assert f"/proc/{child.pid}/stat" not in kept_lines()

    @pytest.mark.parametrize("looks", [0, 1], ids=["before it was opened", "before it was read again"])
    def test_one_that_ends_in_the_middle_of_a_look_is_left_out(
        self,
        procfs: Procfs,
        child: "subprocess.Popen[str]",
        monkeypatch: pytest.MonkeyPatch,
        looks: int,
    ) -> None:
        for _ in range(looks):
            procfs.processes()
        names = os.listdir("/proc")  # noqa: PTH208 - what is replaced
        assert str(child.pid) in names
        child.kill()
        child.wait()
        monkeypatch.setattr(os, "listdir", lambda _path: names)
        seen = by_pid(procfs)
        assert child.pid not in seen
        assert os.getpid() in seen

    def test_one_that_ends_between_opening_and_reading_is_left_out(
        self, procfs: Procfs, child: "subprocess.Popen[str]", monkeypatch: pytest.MonkeyPatch
    ) -> None:
        opening = os.open

        def open_and_end(path: str, flags: int) -> int:
            descriptor = opening(path, flags)
            if path == f"/proc/{child.pid}/stat":
                child.kill()
                child.wait()
            return descriptor

        monkeypatch.setattr(os, "open", open_and_end)
        assert child.pid not in by_pid(procfs)
        assert f"/proc/{child.pid}/stat" not in kept_lines()

    def test_a_later_process_with_its_pid_is_another(
        self, fake: Fake, open_fake: Callable[[], Procfs], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        fake.process(7, b"old", user=500)
        procfs = open_fake()
        (old,) = procfs.processes()
        reading, ended = os.pread, [getattr(old, "descriptor")]  # noqa: B009 - a detail of procfs

        def read(descriptor: int, size: int, offset: int) -> bytes:
            if descriptor in ended:
                ended.clear()
                raise ProcessLookupError  # the kernel's answer for a process that is gone
            return reading(descriptor, size, offset)

        fake.end(7)
        fake.process(7, b"new", user=500)
        monkeypatch.setattr(os, "pread", read)
        (new,) = procfs.processes()
        assert new is not old
        assert (new.pid, new.name) == (7, "new")


class TestTooMany:
    @pytest.fixture(autouse=True)
    def few_descriptors(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(resource, "getrlimit", lambda _what: (6, 4096))

    def test_no_more_are_kept_than_there_is_room_for(
        self, procfs: Procfs, child: "subprocess.Popen[str]"
    ) -> None:
        for _ in range(3):
            assert {1, os.getpid(), child.pid} <= by_pid(procfs).keys()
            assert len(kept_lines()) == 3

    def test_low_numbers_are_left_to_those_who_wait_in_select(
        self, child: "subprocess.Popen[str]", monkeypatch: pytest.MonkeyPatch
    ) -> None:
        soft, hard = limits()
        if soft <= SELECTABLE:
            pytest.skip(f"a process may have {soft} descriptors here")
        monkeypatch.setattr(resource, "getrlimit", lambda _what: (soft, hard))
        procfs = Procfs()
        assert child.pid in by_pid(procfs)
        mine = [one for one in Path("/proc/self/fd").iterdir() if target(one) == f"/proc/{child.pid}/stat"]
        procfs.close()
        assert [int(one.name) >= SELECTABLE for one in mine] == [True]

    def test_without_high_numbers_each_is_opened_anew(
        self, procfs: Procfs, child: "subprocess.Popen[str]", monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def none_left(*_arguments: object) -> int:
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

        monkeypatch.setattr(fcntl, "fcntl", none_left)
        for _ in range(2):
            assert {1, os.getpid(), child.pid} <= by_pid(procfs).keys()
            assert kept_lines() == []

    def test_one_that_is_not_kept_is_known_again_by_its_start(
        self, fake: Fake, open_fake: Callable[[], Procfs]
    ) -> None:
        for pid in range(1, 6):
            fake.process(pid, b"many", started=500)
        procfs = open_fake()
        first = by_pid(procfs)
        (pid,) = list(first)[-1:]
        fake.process(pid, b"many", user=9, started=500)
        assert by_pid(procfs)[pid] is first[pid]
        assert first[pid].cpu_s == pytest.approx(12 * TICK_S)
        fake.process(pid, b"many", user=9, started=501)
        assert by_pid(procfs)[pid] is not first[pid]


class TestRefused:
    @staticmethod
    def refuse(monkeypatch: pytest.MonkeyPatch, error: int, path: str, times: int) -> None:
        opening, left = os.open, [times]

        def refusing(wanted: str, flags: int) -> int:
            if wanted.endswith(path) and left[0]:
                left[0] -= 1
                raise OSError(error, os.strerror(error), wanted)
            return opening(wanted, flags)

        monkeypatch.setattr(os, "open", refusing)

    def test_one_that_is_not_ours_to_see_is_left_out(
        self, procfs: Procfs, child: "subprocess.Popen[str]", monkeypatch: pytest.MonkeyPatch
    ) -> None:
        self.refuse(monkeypatch, errno.EACCES, f"/{child.pid}/stat", times=-1)
        seen = by_pid(procfs)
        assert child.pid not in seen
        assert os.getpid() in seen

    def test_where_others_need_the_descriptors_none_is_kept_and_none_is_missing(
        self, procfs: Procfs, child: "subprocess.Popen[str]", monkeypatch: pytest.MonkeyPatch
    ) -> None:
        self.refuse(monkeypatch, errno.EMFILE, f"/{child.pid}/stat", times=1)
        assert {1, os.getpid(), child.pid} <= by_pid(procfs).keys()
        assert kept_lines() == []
        assert {1, os.getpid(), child.pid} <= by_pid(procfs).keys()

    def test_without_any_descriptor_it_says_so_instead_of_leaving_processes_out(
        self, procfs: Procfs, child: "subprocess.Popen[str]", monkeypatch: pytest.MonkeyPatch
    ) -> None:
        self.refuse(monkeypatch, errno.EMFILE, f"/{child.pid}/stat", times=-1)
        with pytest.raises(OSError, match="Too many open files"):
            procfs.processes()
        assert kept_lines() == []


def test_without_clients_nothing_is_kept(connect: Callable[[], Client]) -> None:
    client = connect()
    client.call("resource.snapshot")
    assert f"/proc/{os.getpid()}/stat" in kept_lines()
    client.close()
    until(lambda: not kept_lines(), "every descriptor is given back")


def test_a_snapshot_needs_no_psutil() -> None:
    code = (
        "import sys; from gateway.wire.messages import ResourceSnapshotParams as P; "
        "from gateway.modules.resource.host import Host; host = Host(); "
        "host.meter().snapshot(P(include=['cmdline'])); host.close(); print('psutil' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout == "False\n"


def test_cpu_time_is_seen_as_it_is_used(procfs: Procfs) -> None:
    before_s = by_pid(procfs)[os.getpid()].cpu_s
    own_s = time.process_time()
    while time.process_time() - own_s < 0.2:
        pass
    used_s = by_pid(procfs)[os.getpid()].cpu_s - before_s
    assert 0.15 <= used_s <= psutil.Process().cpu_times().user + psutil.Process().cpu_times().system
