"""Whether the right process is blamed: a control loop, three programs that now and then take its core.

The programs say when they did. An overrun counts as theirs where one of them had the core for at least half
of the time that the frame was late. Loop, programs and gateway have real-time priorities, so that nothing
else on the computer counts; needs the right to that. `--quick` watches for 15 s instead of 60.
"""

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.bench._control_loop import HOG_PRIORITY, LOOP_NAME, PERIOD_NS, take_place
from tests.bench._daemons import Cost
from tests.unit.gateway import processes
from tests.unit.gateway.harness import Client

SECONDS = 15.0 if "--quick" in sys.argv else 60.0
LATE_MS = 5
HOGS = ("logger", "updater", "camera")
RIGHT = 0.9  # of the overruns
ROBOT = f"""
[robot]
name = "bench"
[gateway]
port = 0
[can.bench]
interface = "socketcand"
channel = "bench"
host = "127.0.0.1"
port = {{port}}
[control_loop]
processes = ["{LOOP_NAME}"]
bus = "bench"
period_ms = {PERIOD_NS / 1e6:g}
late_ms = {LATE_MS}
"""


@dataclass(frozen=True)
class Burst:
    """A time that a program had the core for itself."""

    name: str
    began_ns: int
    ended_ns: int

    def within_ns(self, began_ns: int, ended_ns: int) -> int:
        return max(0, min(self.ended_ns, ended_ns) - max(self.began_ns, began_ns))


def command(*words: object) -> list[str]:
    return [sys.executable, "-m", "tests.bench._control_loop", *map(str, words)]


@contextmanager
def started(*words: object) -> Iterator["subprocess.Popen[str]"]:
    with subprocess.Popen(command(*words), stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.terminate()


def first_line(process: "subprocess.Popen[str]") -> str:
    if process.stdout is None:
        raise RuntimeError("it has no output")
    return process.stdout.readline()


def told(process: "subprocess.Popen[str]") -> list[Burst]:
    said, _ = process.communicate(timeout=SECONDS + 60)
    return [Burst(name, int(began), int(ended)) for name, began, ended in map(str.split, said.splitlines())]


def guilty(overrun: dict[str, Any], bursts: Sequence[Burst]) -> str | None:
    """Who had the core for at least half of the time that it was late; `None` where nobody of ours."""
    ended_ns, late_ns = overrun["stamp_ns"], round(overrun["late_ms"] * 1e6)
    shares = dict.fromkeys(HOGS, 0)
    for burst in bursts:
        shares[burst.name] += burst.within_ns(ended_ns - late_ns - PERIOD_NS, ended_ns)
    most = max(shares, key=lambda hog: shares[hog])
    return most if 2 * shares[most] >= late_ns else None


def watch(
    folder: Path, core: int, other: int
) -> tuple[dict[str, Any], list[dict[str, Any]], list[Burst], float]:
    """The last answer, every overrun, every burst, and the gateway's CPU in percent of a core."""
    with ExitStack() as stack:
        loop = stack.enter_context(started("loop", core))
        file = folder / "robot.toml"
        file.write_text(ROBOT.format(port=int(first_line(loop))), encoding="utf-8")
        gateway = stack.enter_context(processes.process(*processes.GATEWAY, str(file)))
        address = processes.address(gateway)
        take_place(other, HOG_PRIORITY, gateway.pid)  # its threads are born so
        client = stack.enter_context(Client(address))
        client.call("resource.overruns")
        time.sleep(1.0)
        client.call("resource.overruns")  # what came while it all began is nobody's
        hogs = [
            stack.enter_context(started("hog", hog, core, SECONDS, seed)) for seed, hog in enumerate(HOGS)
        ]
        before, found, answer = Cost.of(gateway.pid).cpu_ms, [], {}
        end_s = time.monotonic() + SECONDS + 1.0
        while time.monotonic() < end_s:
            time.sleep(1.0)
            answer = client.call("resource.overruns")
            found += answer["overruns"]
        percent = (Cost.of(gateway.pid).cpu_ms - before) / 10 / (SECONDS + 1.0)
        return answer, found, [burst for hog in hogs for burst in told(hog)], percent


def may_have_priority() -> bool:
    tried = [
        sys.executable,
        "-c",
        f"import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param({HOG_PRIORITY}))",
    ]
    return subprocess.run(tried, capture_output=True, check=False).returncode == 0


def write(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def main() -> int:
    """Print what was found; 1 where the right one is named too seldom."""
    cores = sorted(os.sched_getaffinity(0))
    load = os.getloadavg()[0] / len(cores)
    write(f"Blame on {len(cores)} cores of {platform.machine()}, load {load:.1f} a core")
    if not may_have_priority():
        write("left out: it needs the right to a real-time priority (root, or CAP_SYS_NICE)")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        answer, found, bursts, percent = watch(Path(folder), cores[0], cores[-1])
    theirs = [(one, who) for one in found if (who := guilty(one, bursts)) is not None]
    right = sum(bool(one["instead"]) and one["instead"][0]["name"] == who for one, who in theirs)
    share = right / max(1, len(theirs))
    write(f"{answer['missed']} of {answer['cycles']} cycles were late")
    write(f"{len(bursts)} times somebody took the core")
    write(f"{len(theirs)} overruns are theirs; the right one is named first in {right}: {100 * share:.1f} %")
    write(f"{len(found) - len(theirs)} others, by what else the computer does")
    write(f"the gateway used {percent:.1f} % of a core meanwhile")
    for one, who in theirs:
        if not one["instead"] or one["instead"][0]["name"] != who:
            named = ", ".join(f"{ran['name']} {ran['ran_ms']:.1f} ms" for ran in one["instead"])
            write(f"  {one['late_ms']:.1f} ms late by {who}, and named: {named or 'nobody'}")
    figures = {
        "overruns": len(theirs),
        "right": right,
        "share": round(share, 4),
        "cpu_percent": round(percent, 2),
    }
    write(json.dumps({"benchmark": "blame", **figures}))
    kept = bool(theirs) and share >= RIGHT
    write(f"at least {100 * RIGHT:g} % right: {'kept' if kept else 'NOT KEPT'}")
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
