"""A robot as a process: opened, announced on standard output, run until a signal, closed."""

import json
import signal
import sys
from collections.abc import Callable
from types import FrameType

from hil_sim.real_time import RealTimeCheck
from hil_sim.simulation_host import SimulationHost


def say(sentence: str) -> None:
    """Print a line for the parent process."""
    sys.stderr.write(f"gwrms sim: {sentence}\n")


def run(robot: SimulationHost, seconds: float | None, prepare: Callable[[], None]) -> int:
    """Run `robot` until SIGINT, SIGTERM or so many seconds; `prepare` is called when it is open.

    Returns the exit status.
    """

    def end(_signal: int, _frame: FrameType | None) -> None:
        robot.stop()

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        robot.open()
        prepare()
        RealTimeCheck(robot.loop, say)
        if not robot.config_is_ours:
            say(f"kept {robot.config} as it is; delete it to have it written anew")
            for one in robot.disagreements:
                say(f"{one}: delete the file, simulate what it says, or take another --dir")
        sys.stdout.write(json.dumps({"ready": True, "config": str(robot.config)}) + "\n")
        sys.stdout.flush()
        robot.run(seconds)
    finally:
        robot.close()
        for number, handler in before.items():
            signal.signal(number, handler)
    return 0
