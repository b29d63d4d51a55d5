"""On a Dask cluster: the same bits as here, a worker's death changes nothing, and no key ever travels."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest

from ml.errors import UnusableData
from ml.store import Store
from ml.training import extract as module
from ml.training.dataset import Ask, LeftOut, SessionDecisions, part, versions
from ml.training.extract import extract
from tests.stores import SECRET
from tests.support.waiting import until
from tests.unit.training.walkers import day, put

RECIPE = "activity/hips+knees"
SESSIONS = 4
# It prints the workers' process ids, and for each line of its input those that have something to do.
CLUSTER = """
import os, sys
from distributed import Client, LocalCluster

if __name__ == "__main__":
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        pids = client.run(os.getpid)
        print(cluster.scheduler_address, *pids.values(), flush=True)
        for _ in sys.stdin:
            busy = [pids[name] for name, tasks in client.processing().items() if tasks and name in pids]
            print(*busy, flush=True)
"""


@dataclass(frozen=True)
class Cluster:
    process: "subprocess.Popen[str]"
    address: str
    workers: list[int]

    def busy(self) -> list[int]:
        """The workers that have something to do."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write("?\n")
        self.process.stdin.flush()
        return [int(pid) for pid in self.process.stdout.readline().split()]


@pytest.fixture
def cluster(store_url: str, tmp_path: Path) -> Iterator[Cluster]:
    """Two workers, in processes of their own, whose environment knows the store's keys."""
    command = [sys.executable, "-c", CLUSTER]
    with (
        (tmp_path / "log").open("wb") as log,
        subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, text=True, cwd=tmp_path
        ) as process,
    ):
        assert process.stdout is not None
        address, *pids = process.stdout.readline().split()
        yield Cluster(process, address, [int(pid) for pid in pids])
        process.communicate()


def asks(url: str) -> list[Ask]:
    pinned = versions(Store(url), ["exo"])
    return [Ask(url, pinned, "exo", f"s{number}", RECIPE) for number in range(SESSIONS)]


@pytest.mark.parametrize("backend", ["s3"], indirect=True)
def test_a_cluster_gives_the_same_bits_though_a_worker_is_killed_and_by_its_own_keys(
    store_url: str, cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(store_url, tmp_path / "spool", [day(f"s{number}", number, each_s=2.0) for number in range(SESSIONS)])
    wanted = [*asks(store_url), Ask(store_url, asks(store_url)[0].versions, "exo", "nobody", RECIPE)]
    here = extract(wanted)
    for name in list(os.environ):
        if name.startswith("AWS_"):
            monkeypatch.delenv(name)
    victim = cluster.workers[0]
    os.kill(victim, signal.SIGSTOP)  # so that it is given something, and never does it
    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(extract, wanted, cluster.address)
        until(lambda: coming.done() or victim in cluster.busy(), "it is given something")
        assert not coming.done()
        os.kill(victim, signal.SIGKILL)
        there = coming.result(150)
    assert isinstance(here[-1], LeftOut)
    assert here[-1] == there[-1]
    for one, other in zip(here[:-1], there[:-1], strict=True):
        assert isinstance(one, SessionDecisions)
        assert isinstance(other, SessionDecisions)
        assert (one.ask, one.group, one.regression) == (other.ask, other.group, other.regression)
        for name in ("features", "truth", "source", "stamps_ns", "ranges"):
            mine, its = getattr(one, name), getattr(other, name)
            assert mine.dtype == its.dtype
            assert mine.tobytes() == its.tobytes()


def test_what_travels_holds_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    from distributed.protocol.serialize import serialize

    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", SECRET)
    ask = Ask("s3://bucket/prefix", {"telemetry/000": 3}, "exo", "s0", RECIPE)
    header, frames = serialize((part, ask))
    sent = repr(header).encode() + b"".join(bytes(frame) for frame in frames)
    assert b"s3://bucket/prefix" in sent
    assert SECRET.encode() not in sent


def test_a_cluster_that_is_not_there_is_said_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PATIENCE_S", 0.5)
    ask = Ask("s3://bucket/prefix", {}, "exo", "s0", RECIPE)
    with pytest.raises(UnusableData, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        extract([ask], "tcp://127.0.0.1:9")


def test_without_a_cluster_no_dask_is_loaded() -> None:
    script = (
        "import sys, server_gui.cli.train as t; "
        "from ml.training.extract import extract; assert extract([]) == []; "
        "print([name for name in ('dask', 'distributed') if name in sys.modules])"
    )
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
