"""The measured parts of `./dev bench blame`, each a process of its own with a name that the kernel knows.

`python -m tests.bench._control_loop loop CORE`: a control loop that works 2 ms of each 10 and then sends a
SYNC; it is a socketcand server for one gateway, and its first line says on which port.
`python -m tests.bench._control_loop hog NAME CORE SECONDS SEED`: takes the core for itself now and then, at a
real-time priority, and prints when: `NAME BEGAN_NS ENDED_NS` on the monotonic clock.
"""

import os
import random
import socket
import sys
import time
from pathlib import Path

PERIOD_NS, WORK_NS = 10_000_000, 2_000_000
PAUSE_S, BURST_S = (0.3, 0.8), (0.020, 0.060)
LOOP_PRIORITY, HOG_PRIORITY = 5, 10  # real-time (SCHED_FIFO)
LOOP_NAME = "exo_control"


def take_place(core: int, priority: int, pid: int = 0) -> None:
    """Run on one core, ahead of everything that has no real-time priority, or a lower one."""
    os.sched_setaffinity(pid, {core})
    os.sched_setscheduler(pid, os.SCHED_FIFO, os.sched_param(priority))


def loop(core: int) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        sys.stdout.write(f"{server.getsockname()[1]}\n")
        sys.stdout.flush()
        wire, _ = server.accept()
    shake_hands(wire)
    take_place(core, LOOP_PRIORITY)
    due_ns = time.monotonic_ns()
    while True:
        due_ns = max(due_ns + PERIOD_NS, time.monotonic_ns())
        time.sleep(max(0, due_ns - time.monotonic_ns()) / 1e9)
        work(WORK_NS)
        try:
            wire.sendall(b"< frame 080 1.000000  >")
        except OSError:  # the gateway has gone
            return


def shake_hands(wire: socket.socket) -> None:
    """As a socketcand server does, until its client wants frames."""
    wire.sendall(b"< hi >")
    for _ in ("open", "rawmode"):
        wire.recv(4096)
        wire.sendall(b"< ok >")
    time.sleep(0.1)  # a client expects its last "< ok >" alone in one read


def hog(name: str, core: int, seconds: float, seed: int) -> None:
    choose = random.Random(seed)
    take_place(core, HOG_PRIORITY)
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        time.sleep(choose.uniform(*PAUSE_S))
        began_ns = time.monotonic_ns()
        ends_ns = began_ns + round(choose.uniform(*BURST_S) * 1e9)
        while time.monotonic_ns() < ends_ns:
            pass
        sys.stdout.write(f"{name} {began_ns} {time.monotonic_ns()}\n")
        sys.stdout.flush()


def work(for_ns: int) -> None:
    """Of the processor's own time, not of the clock's."""
    end_ns = time.thread_time_ns() + for_ns
    while time.thread_time_ns() < end_ns:
        pass


def main() -> None:
    what, *words = sys.argv[1:]
    name = LOOP_NAME if what == "loop" else words[0]
    Path("/proc/self/comm").write_text(name, encoding="ascii")
    if what == "loop":
        loop(int(words[0]))
    else:
        hog(name, int(words[1]), float(words[2]), int(words[3]))


if __name__ == "__main__":
    main()
