"""Several servers on one store, and a store that goes away in the middle of an upload."""

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from ml.store import Store
from ml.store.tables import TELEMETRY
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.uploader import Uploader
from tests.slow_network import SlowNetwork
from tests.stores import BUCKET, SeaweedFS
from tests.support.waiting import WAIT_S, until
from tests.unit.recording.robots import batch

COMMITS = 10
HERE = TELEMETRY.location("exo-01", 1)


@pytest.mark.parametrize("servers", [2, 4])
def test_servers_that_write_at_once_lose_no_commit(store_url: str, servers: int) -> None:
    module = "tests.scenario.recording_writer"
    writers = [
        subprocess.Popen([sys.executable, "-m", module, store_url, f"exo-{number}", str(COMMITS)])
        for number in range(servers)
    ]
    assert [writer.wait(150) for writer in writers] == [0] * servers
    rows = Store(store_url).dataset("events").to_table(columns=["robot", "number"]).to_pylist()
    expected = [(f"exo-{writer}", number) for writer in range(servers) for number in range(1, COMMITS + 1)]
    assert sorted((row["robot"], row["number"]) for row in rows) == sorted(expected)


@pytest.fixture
def server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, store_libraries: None) -> Iterator[SeaweedFS]:
    with SeaweedFS(tmp_path / "seaweedfs") as started:
        for name, value in started.environment.items():
            monkeypatch.setenv(name, value)
        yield started


def test_a_store_that_dies_in_the_middle_of_an_upload_gets_everything_once_it_is_back(
    server: SeaweedFS, tmp_path: Path
) -> None:
    url = f"s3://{BUCKET}/dies"
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool:
        for begin in range(0, 40, 10):  # four segments
            with Recorder(spool) as recorder:
                for seq in range(begin, begin + 10):
                    recorder.record("exo-01", 1, batch(seq, rows=50))
        connected = threading.Event()

        def connect() -> Store:
            store = Store(url, several_writers=False)
            connected.set()
            return store

        with Uploader(spool, connect) as uploader:
            assert connected.wait(WAIT_S)
            server.kill()  # while it writes the first segments
            until(lambda: uploader.state.problem is not None or uploader.state.uploaded == 4)
            server.start()
            uploader.now()
            until(lambda: uploader.state.uploaded == 4, lambda: uploader.state)
            assert uploader.state.problem is None
        table = Store(url, several_writers=False).dataset(HERE).to_table(columns=["seq", "row"])
        found = list(zip(table["seq"].to_pylist(), table["row"].to_pylist(), strict=True))
        assert sorted(found) == [(seq, row) for seq in range(40) for row in range(50)]


@pytest.mark.parametrize("backend", ["s3"], indirect=True)
def test_a_slow_network_that_is_cut_again_and_again_delays_an_upload_and_nothing_else(
    backend: SeaweedFS, store_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (
        SlowNetwork(backend.port, delay_s=0.02) as network,
        Spool(tmp_path / "spool", reserve_bytes=0) as spool,
    ):
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{network.port}")
        with Recorder(spool) as recorder:
            for seq in range(20):
                recorder.record("exo-01", 1, batch(seq, rows=50))
        with Uploader(spool, lambda: Store(store_url)) as uploader:
            until(lambda: network.carried > 1_000)
            network.cut()
            uploader.now()
            until(lambda: network.carried > 5_000)
            network.cut()
            uploader.now()
            until(lambda: uploader.state.uploaded == 1, lambda: uploader.state)
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{backend.port}")
        table = Store(store_url).dataset(HERE).to_table(columns=["seq", "row"])
    found = list(zip(table["seq"].to_pylist(), table["row"].to_pylist(), strict=True))
    assert sorted(found) == [(seq, row) for seq in range(20) for row in range(50)]
