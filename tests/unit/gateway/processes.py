"""`gwrms gateway` as a process of its own, seen as the kernel sees it."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

GATEWAY = (sys.executable, "-P", "-m", "gateway.main", "gateway")
RESTS_SOON = """
[robot]
name = "exo-test"
[gateway]
port = 0
linger_s = 0.05
"""


@contextlib.contextmanager
def process(*command: str, environ: Mapping[str, str] = os.environ) -> Iterator["subprocess.Popen[str]"]:
    """A process that is killed with the block, and with all that it has started."""
    pipe = subprocess.PIPE
    with subprocess.Popen(
        command, stdout=pipe, stderr=pipe, text=True, env=environ, start_new_session=True
    ) as running:
        try:
            yield running
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(running.pid, signal.SIGKILL)


def address(running: "subprocess.Popen[str]") -> tuple[str, int]:
    """What it says that it listens on."""
    assert running.stdout is not None
    match = re.fullmatch(r"listening on (127\.0\.0\.1):(\d+)\n", running.stdout.readline())
    assert match is not None
    return match[1], int(match[2])


def rests(pid: int) -> bool:
    """Whether it is the small process that waits, and sleeps."""
    script = b"/gateway/process/resting.py\0" in Path(f"/proc/{pid}/cmdline").read_bytes()
    return script and Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(") ")[2].startswith("S")


def kernel_saw(pid: int) -> tuple[int, ...]:
    """CPU ticks and context switches of the whole process so far."""
    ticks = Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(") ")[2].split()[11:13]
    switches = [
        number
        for status in Path(f"/proc/{pid}/task").glob("*/status")
        for number in re.findall(r"ctxt_switches:\s+(\d+)", status.read_text("ascii"))
    ]
    return tuple(map(int, [*ticks, *switches]))


def sleeps(pid: int) -> bool:
    """Whether a second passes in which it uses no tick, of the hundred there are, and nothing wakes it."""
    before = kernel_saw(pid)
    for wait_s in (0.1, 0.9):
        time.sleep(wait_s)
        if kernel_saw(pid) != before:
            return False
    return True


def resident_mb(pid: int) -> float:
    rollup = Path(f"/proc/{pid}/smaps_rollup").read_text("ascii")
    return int(re.findall(r"Rss:\s+(\d+) kB", rollup)[0]) / 1024
