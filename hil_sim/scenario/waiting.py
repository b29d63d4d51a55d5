"""Time that a process was ready to run without a free processor, by Linux's scheduler."""

import contextlib
from pathlib import Path

_DELAY = (
    1  # of the numbers in schedstat: ns spent waiting to run (Linux: Documentation/scheduler/sched-stats)
)


class Waiting:
    """Waiting time of the process `pid`, thread by thread."""

    def __init__(self, pid: int, proc: Path = Path("/proc")) -> None:
        self._tasks = proc / str(pid) / "task"
        self._before = self._delays()

    def take_s(self) -> float:
        """Return the longest that one thread has waited since the last call; 0 where nobody tells."""
        now = self._delays()
        waited = [delay_ns - self._before.get(task, 0) for task, delay_ns in now.items()]
        self._before = now
        return max(waited, default=0) / 1e9

    def _delays(self) -> dict[str, int]:
        found = {}
        with contextlib.suppress(OSError):
            for task in self._tasks.iterdir():
                with contextlib.suppress(OSError, ValueError, IndexError):  # it has ended, or is not told
                    words = (task / "schedstat").read_text(encoding="ascii").split()
                    found[task.name] = int(words[_DELAY])
        return found
