"""The daemons that are measured side by side: how each is started, and what it has cost so far."""

import os
import re
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

WAIT_S = 60.0
TICK_MS = 1000 / os.sysconf("SC_CLK_TCK")
ROBOT = """
[robot]
name = "bench"
[gateway]
host = "{host}"
port = {port}
classic_port = {classic_port}
linger_s = 2
records = "records"
"""


@dataclass(frozen=True)
class Program:
    """One daemon: the file that has to be there, and its command for a host, a port and a folder."""

    name: str
    needs: str | None
    command: Callable[[str, int, Path], list[str]]
    package: str = ""


def _gateway(host: str, port: int, folder: Path) -> list[str]:
    file = folder / "robot.toml"
    file.write_text(ROBOT.format(host=host, port=port, classic_port=free_port(host)), encoding="utf-8")
    return [sys.executable, "-P", "-m", "gateway.main", "gateway", str(file)]


def _paper(host: str, port: int, _folder: Path) -> list[str]:
    return ["lua5.4", str(Path(__file__).with_name("paper_daemon.lua")), host, str(port)]


def _glances(host: str, port: int, _folder: Path) -> list[str]:
    return ["glances", "-s", "-B", host, "-p", str(port), "--disable-autodiscover"]


def _node_exporter(host: str, port: int, _folder: Path) -> list[str]:
    return ["prometheus-node-exporter", f"--web.listen-address={host}:{port}", "--log.level=error"]


PROGRAMS = (
    Program("gwrms", None, _gateway),
    Program("paper", "lua5.4", _paper, "lua5.4 lua-socket"),
    Program("glances", "glances", _glances, "glances"),
    Program("node_exporter", "prometheus-node-exporter", _node_exporter, "prometheus-node-exporter"),
)


@dataclass(frozen=True)
class Cost:
    """What a process has used since it began, what its ended children have, and what it holds now."""

    cpu_ms: float
    wake_ups: int
    memory_kb: Mapping[str, int]  # Rss, Pss, Uss

    @classmethod
    def of(cls, pid: int) -> "Cost":
        fields = Path(f"/proc/{pid}/stat").read_bytes().rpartition(b") ")[2].split()
        ticks = sum(map(int, fields[11:15]))
        status = "".join(
            file.read_text(encoding="utf-8") for file in Path(f"/proc/{pid}/task").glob("*/status")
        )
        switches = re.findall(r"ctxt_switches:\s+(\d+)", status)
        rollup = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii")
        held = {name: int(kb) for name, kb in re.findall(r"(\w+):\s+(\d+) kB", rollup)}
        memory = {
            "rss": held["Rss"],
            "pss": held["Pss"],
            "uss": held["Private_Clean"] + held["Private_Dirty"],
        }
        return cls(ticks * TICK_MS, sum(map(int, switches)), memory)


@dataclass(frozen=True)
class Running:
    """A daemon that answers."""

    program: Program
    pid: int
    host: str
    port: int
    classic_port: int | None
    fresh: Cost  # before anybody has asked

    @property
    def cost(self) -> Cost:
        return Cost.of(self.pid)


def free_port(host: str) -> int:
    with socket.create_server((host, 0)) as free:
        return int(free.getsockname()[1])


def absent(program: Program) -> bool:
    """Whether it cannot be run here; of the paper's, Lua's sockets count too."""
    if program.needs is None:
        return False
    if shutil.which(program.needs) is None:
        return True
    if program.name != "paper":
        return False
    return (
        subprocess.run(["lua5.4", "-e", "require 'socket'"], capture_output=True, check=False).returncode != 0
    )


@contextmanager
def running(program: Program, host: str, folder: Path) -> Iterator[Running]:
    """Started, and ended with the block."""
    port = free_port(host)
    command = program.command(host, port, folder)
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            _await(process, host, port)
            said = re.search(r"classic_port = (\d+)", _text(folder / "robot.toml"))
            classic_port = int(said[1]) if said and program.name == "gwrms" else None
            yield Running(program, process.pid, host, port, classic_port, Cost.of(process.pid))
        finally:
            process.terminate()
            try:
                process.wait(WAIT_S)
            except subprocess.TimeoutExpired:
                process.kill()


def _await(process: "subprocess.Popen[bytes]", host: str, port: int) -> None:
    deadline = time.monotonic() + WAIT_S
    while process.poll() is None and time.monotonic() < deadline:
        with socket.socket() as probe:
            if probe.connect_ex((host, port)) == 0:
                break
        time.sleep(0.05)
    else:
        raise RuntimeError(f"{process.args!r} does not listen on {host}:{port}")
    time.sleep(1.0)  # what it still does after that belongs to nobody's request


def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8") if file.exists() else ""
