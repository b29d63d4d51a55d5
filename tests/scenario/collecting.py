"""`gwrms collect` as a process, and what it has brought into its store."""

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import pyarrow.compute as pc

from ml.store import Store
from ml.store.errors import NoSuchTable
from ml.store.tables import TELEMETRY
from server_gui.core.fleet.collector import CollectorReport
from server_gui.core.fleet.control_socket import NobodyCollects, ask
from tests.scenario.processes import DEADLINE_S, until

KEYS = ("session", "connection", "stream", "seq", "row", "stamp_ns")
GONE = {
    "gap",
    "dropped",
    "shed",
    "lost",
    "refused",
    "link",
}  # kinds of events that tell of rows that are not there


class Collecting:
    """A collector with a folder of its own, that can be killed and started again."""

    def __init__(self, folder: Path, robots: Mapping[str, str], batch_s: float = 2.0) -> None:
        self.config = folder / "server.toml"
        self.spool = folder / "spool"
        self.url = (folder / "store").as_uri()
        lines = ["[robots]", *(f'{name} = "{address}"' for name, address in robots.items())]
        lines += ["[store]", f'url = "{self.url}"', "[prediction]", "enabled = false"]
        lines += ["[recorder]", f'spool = "{self.spool}"', f"batch_s = {batch_s}", ""]
        self.config.write_text("\n".join(lines))
        self._log = folder / "collect.log"
        self._answer = b""
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        command = [sys.executable, "-P", "-m", "gateway.main", "collect", "--config", str(self.config)]
        with self._log.open("ab") as log:
            self._process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=log, process_group=0)
        self.report()

    def log(self) -> str:
        return self._log.read_text()

    def report(self) -> CollectorReport:
        """Waits for the answer, for as long as a busy computer takes."""
        until(self._answers, self.log)
        return msgspec.json.decode(self._answer, type=CollectorReport)

    def rows(self) -> dict[str, int]:
        return {robot: link.rows for robot, link in self.report().robots.items()}

    def until_more(self, rows: int) -> None:
        """Wait until each robot has sent so many more."""
        before = self.rows()
        until(lambda: all(now >= before[robot] + rows for robot, now in self.rows().items()), self.log)

    def kill(self) -> None:
        self._end(signal.SIGKILL)

    def end(self) -> int:
        """End it as systemd does; its exit status."""
        return self._end(signal.SIGTERM)

    def close(self) -> None:
        if self._process is not None:
            self.kill()

    def kept(self, robot: str) -> "Kept":
        return Kept(self.url, robot)

    def _answers(self) -> bool:
        assert self._process is not None
        assert self._process.poll() is None, self.log()
        with contextlib.suppress(NobodyCollects):
            self._answer = ask(self.spool, "status")
            return True
        return False

    def _end(self, number: signal.Signals) -> int:
        assert self._process is not None
        os.kill(self._process.pid, number)
        status = self._process.wait(DEADLINE_S)
        self._process = None
        return status


class Kept:
    """One robot's rows in the store, and what is told of those that are missing."""

    def __init__(self, url: str, robot: str) -> None:
        store = Store(url)
        found = store.dataset(TELEMETRY.location(robot, 1))
        table = found.to_table(columns=list(KEYS), filter=pc.field("robot") == robot)
        self.rows: list[dict[str, Any]] = table.sort_by([(key, "ascending") for key in KEYS]).to_pylist()
        self.sessions = set(table["session"].to_pylist())
        self.events = self._events(store, robot)

    @staticmethod
    def _events(store: Store, robot: str) -> list[dict[str, Any]]:
        try:
            found = store.dataset("events").to_table(filter=pc.field("robot") == robot).to_pylist()
        except NoSuchTable:
            return []
        return [event for event in found if event["kind"] in GONE]

    def connections(self) -> dict[str, list[dict[str, Any]]]:
        """The rows of each connection, in order."""
        found: dict[str, list[dict[str, Any]]] = {}
        for row in self.rows:
            found.setdefault(row["connection"], []).append(row)
        return found
