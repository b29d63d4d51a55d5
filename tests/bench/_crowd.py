"""Many cheap processes that do nothing, and a network of its own for the one who asks."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

NAMESPACE, OUTSIDE, INSIDE = "gwrms-bench", "gwrms-bench0", "gwrms-bench1"
SERVER, CLIENT = "198.51.100.1", "198.51.100.2"  # addresses of documentation (RFC 5737)

# Forks, says so, and ends its children when its input ends: with the block, or with a bench that was killed.
_PARENT = """
import os, signal, sys
children = []
for _ in range(int(sys.argv[1])):
    child = os.fork()
    if not child:
        os.close(0)
        while True:
            signal.pause()
    children.append(child)
print(flush=True)
sys.stdin.read()
for child in children:
    os.kill(child, signal.SIGKILL)
for child in children:
    os.waitpid(child, 0)
"""


def processes_now() -> int:
    return sum(name.isdecimal() for name in os.listdir("/proc"))  # noqa: PTH208 - names are all we want


@contextmanager
def crowd(total: int) -> Iterator[None]:
    """So many processes that the computer has `total`; none where it has as many already."""
    missing = total - processes_now()
    if missing <= 0:
        yield
        return
    command = [sys.executable, "-I", "-S", "-c", _PARENT, str(missing)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as parent:  # its end closes the input
        if parent.stdout is None or not parent.stdout.readline():
            raise RuntimeError(f"{missing} processes could not be started")
        yield


@contextmanager
def namespace() -> Iterator[str | None]:
    """A network namespace and a cable to it; `None` where we may not make one."""
    with ExitStack() as made:
        try:
            _make(made)
        except (OSError, subprocess.CalledProcessError):
            made.close()
            yield None
        else:
            yield NAMESPACE


def _make(made: ExitStack) -> None:
    if shutil.which("ip") is None or os.geteuid() != 0:
        raise PermissionError("network namespaces are root's")
    subprocess.run(["ip", "netns", "delete", NAMESPACE], check=False, capture_output=True)  # of a killed run
    _ip("netns", "add", NAMESPACE)
    made.callback(_ip, "netns", "delete", NAMESPACE)
    _ip("link", "add", OUTSIDE, "type", "veth", "peer", "name", INSIDE, "netns", NAMESPACE)
    made.callback(_ip, "link", "delete", OUTSIDE)
    for name, inside, address in ((OUTSIDE, [], SERVER), (INSIDE, ["-n", NAMESPACE], CLIENT)):
        _ip(*inside, "address", "add", f"{address}/30", "dev", name)
        _ip(*inside, "link", "set", name, "up")


def inside(command: Sequence[str]) -> list[str]:
    """The command, as one of that network."""
    return ["ip", "netns", "exec", NAMESPACE, *command]


def wire_bytes() -> int:
    """What has passed the cable in both directions, Ethernet's and TCP's own bytes among it."""
    counters = Path("/sys/class/net", OUTSIDE, "statistics")
    return sum(int((counters / name).read_text(encoding="ascii")) for name in ("rx_bytes", "tx_bytes"))


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)
