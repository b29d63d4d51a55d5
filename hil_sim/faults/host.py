"""Faults of the computer itself: its processor, memory and disk are taken by real programs of ours.

They act on the computer that runs the simulator, in real time. Their programs end with the fault, and with
the simulator however that ends.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from hil_sim.faults.fault import Fault, FaultRefused, FaultTarget, FolderName, Form, Number, Site

_MEGABYTE = 1 << 20
_MEMORY_SHARE = 0.5  # of what is available: the bench itself must live
_END_S = 5.0  # a program that does not end by itself within this is killed


@contextmanager
def _hog(*words: str) -> Iterator[None]:
    command = [sys.executable, "-P", "-m", "hil_sim.faults.hog", *words]
    with subprocess.Popen(command, stdin=subprocess.PIPE, process_group=0) as program:
        yield
        if program.stdin is not None:
            program.stdin.close()
        try:
            program.wait(_END_S)
        except subprocess.TimeoutExpired:
            program.kill()


@contextmanager
def _processor(site: Site) -> Iterator[None]:
    with ExitStack() as programs:
        for _ in range(site.whole("cores") or os.cpu_count() or 1):
            programs.enter_context(_hog("processor"))
        yield


def available_memory() -> int:
    """Return bytes that programs can still get."""
    for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
        if line.startswith("MemAvailable:"):
            return int(line.split()[1]) * 1024
    raise FaultRefused("/proc/meminfo does not say how much memory is available")


@contextmanager
def _memory(site: Site) -> Iterator[None]:
    size, allowed = site.whole("megabytes") * _MEGABYTE, available_memory() * _MEMORY_SHARE
    if size > allowed:
        raise FaultRefused(
            f"megabytes = {site.whole('megabytes')} is more than half of what is available here: "
            f"give at most {allowed / _MEGABYTE:.0f}"
        )
    with _hog("memory", str(size)):
        yield


@contextmanager
def _disk(site: Site) -> Iterator[None]:
    with ExitStack() as programs:
        for number in range(site.whole("writers")):
            file = site.folder("folder") / f".slow_disk.{os.getpid()}.{number}"
            programs.enter_context(_hog("disk", str(file), str(site.whole("megabytes") * _MEGABYTE)))
        yield


FAULTS = {
    "cpu_hog": Fault(
        FaultTarget.HOST,
        _processor,
        "The processor is busy: the resource module shows it, a process `hil_sim.faults.hog` stands first.",
        {"cores": Number(0, 0, 256, "", "how many to keep busy; 0 is all of them", Form.WHOLE)},
    ),
    "memory_hog": Fault(
        FaultTarget.HOST,
        _memory,
        "Available memory shrinks by so much: the resource module shows it and the process that holds it.",
        {
            "megabytes": Number(
                512, 1, 65_536, "MB", "how much, at most half of what is available", Form.WHOLE
            )
        },
    ),
    "slow_disk": Fault(
        FaultTarget.HOST,
        _disk,
        "Programs that wait for the same disk (fsync) wait longer, for it is kept busy; not so in tmpfs.",
        {
            "folder": FolderName("a folder on the disk; empty for the simulator's own"),
            "writers": Number(2, 1, 16, "", "programs that write", Form.WHOLE),
            "megabytes": Number(32, 1, 1024, "MB", "what each writes over and over", Form.WHOLE),
        },
    ),
}
