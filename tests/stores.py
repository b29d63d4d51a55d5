"""Stores for tests: a folder, and a real S3 server that is started for them.

Every test imports this file, so the store's libraries are imported only by those that ask for a store.
"""

import contextlib
import gc
import http.client
import json
import os
import random
import socket
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Self

import msgspec
import pytest

KEY, SECRET = "tests-key", "tests-secret-0123456789"
BUCKET = "tests"
START_S = 50.0


class SeaweedFS:
    """An S3 server on this computer alone; use it as a context manager. It keeps its data over a restart."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        identity = {
            "name": "tests",
            "credentials": [{"accessKey": KEY, "secretKey": SECRET}],
            "actions": ["Admin", "Read", "Write", "List", "Tagging"],
        }
        (folder / "s3.json").write_text(json.dumps({"identities": [identity]}))
        self._ports = _ports(4)
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self.kill()

    @property
    def port(self) -> int:
        return self._ports[3]

    @property
    def environment(self) -> dict[str, str]:
        """What a client of it needs in its environment."""
        return {
            "AWS_ACCESS_KEY_ID": KEY,
            "AWS_SECRET_ACCESS_KEY": SECRET,
            "AWS_REGION": "us-east-1",
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{self.port}",
        }

    def start(self) -> None:
        """Start it, and wait until it answers."""
        master, volume, filer, s3 = self._ports
        command = [
            str(Path(sys.executable).with_name("weed")), "-logtostderr=true", "server",
            f"-dir={self.folder}", "-ip=127.0.0.1", "-ip.bind=127.0.0.1",
            f"-master.port={master}", f"-volume.port={volume}", f"-filer.port={filer}",
            "-s3", f"-s3.port={s3}", "-s3.port.iceberg=0", "-s3.port.lance=0",
            f"-s3.config={self.folder / 's3.json'}",
            "-master.volumeSizeLimitMB=64", "-volume.max=50", "-master.telemetry=false",
            "-master.resumeState=false", "-master.electionTimeout=1s",
        ]  # fmt: skip
        # It would let in whoever the environment names.
        environment = {name: value for name, value in os.environ.items() if not name.startswith("AWS_")}
        with (self.folder / "log").open("ab") as log:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                cwd=self.folder,
                env=environment,
            )
        deadline_s = time.monotonic() + START_S
        while not self._answers():
            if self._process.poll() is not None or time.monotonic() > deadline_s:
                self.kill()
                raise RuntimeError((self.folder / "log").read_text()[-2000:])
            time.sleep(0.05)

    def kill(self) -> None:
        """End it at once."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
        for port in self._ports:  # it makes sockets of its own there, and leaves them
            for name in (port, port + 10_000):
                for left in Path("/tmp").glob(f"seaweedfs-*-{name}.sock"):
                    left.unlink(missing_ok=True)

    def _answers(self) -> bool:
        """Whether an object can be written: its parts come up one after another."""
        write = (
            "import obstore; from obstore.store import from_url; "
            f"obstore.put(from_url('s3://{BUCKET}', client_options={{'allow_http': True}}, "
            "retry_config={'max_retries': 0}), 'up', b'')"
        )
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=2)
        try:
            connection.request("GET", "/status")
            if connection.getresponse().status != 200:
                return False
        except OSError:
            return False
        finally:
            connection.close()
        found = subprocess.run(
            [sys.executable, "-c", write], env=os.environ | self.environment, check=False, capture_output=True
        )
        return found.returncode == 0


def _ports(count: int) -> list[int]:
    """Ports that are free, and so is the one 10,000 above each, where gRPC listens."""
    found: list[int] = []
    with contextlib.ExitStack() as opened:
        while len(found) < count:
            port = random.randrange(11_000, 22_000)
            try:
                for each in (port, port + 10_000):
                    opened.enter_context(socket.create_server(("127.0.0.1", each)))
            except OSError:
                continue
            found.append(port)
    return found


@pytest.fixture(scope="session")
def store_libraries(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Their threads and wake-up sockets, which stay for as long as the process lives."""
    from ml.store import Store
    from ml.store.tables import EVENTS

    store = Store(tmp_path_factory.mktemp("first").as_uri())
    data = EVENTS.rows([{"robot": "nobody"}])
    store.append(EVENTS, "events", data.schema, data.to_reader, "tests", 1)
    store.dataset("events").to_table()


@pytest.fixture
def folder_url(store_libraries: None, tmp_path: Path) -> str:
    """A store in a folder, where it does not matter which kind of store it is."""
    return (tmp_path / "store").as_uri()


@pytest.fixture(scope="session", params=["folder", "s3"])
def backend(
    request: pytest.FixtureRequest, store_libraries: None, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[SeaweedFS | None]:
    """Every test that asks for it runs on a folder, and on an S3 server."""
    if request.param == "folder":
        yield None
        return
    from ml.store import Store

    with SeaweedFS(tmp_path_factory.mktemp("seaweedfs")) as server:
        with pytest.MonkeyPatch.context() as patch:
            for name, value in server.environment.items():
                patch.setenv(name, value)
            Store(f"s3://{BUCKET}/first", several_writers=False).units("none")
        yield server


@pytest.fixture
def new_store_url(
    backend: SeaweedFS | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[str]:
    """Where no store is yet; the environment says how it is reached."""
    if backend is None:
        yield (tmp_path / "store").as_uri()
    else:
        for name, value in backend.environment.items():
            monkeypatch.setenv(name, value)
        yield f"s3://{BUCKET}/{uuid.uuid4().hex}"
    gc.collect()  # tracebacks of expected errors hold stores, and these their sockets
    if not gc.get_freeze_count():
        gc.freeze()  # what stays, pytest and all that it has collected, is not looked through every time


@pytest.fixture
def store_url(new_store_url: str) -> str:
    """A store that is still empty, and known to keep writers apart: the probe takes seconds on SeaweedFS."""
    from ml.store.objects import Objects
    from ml.store.store import About

    Objects(new_store_url).create("store.json", msgspec.json.encode(About()))
    return new_store_url
