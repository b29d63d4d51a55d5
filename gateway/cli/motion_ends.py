"""The end of a command that may have powered a joint: by a signal, or by a stop of every drive."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from drivers.errors import DriverError
from gateway.cli.text import say, say_json
from gateway.commission.bench import CanBench
from gateway.commission.draft import Draft
from gateway.commission.stopping import Stopped, stop

ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def stop_drives(draft: Draft, bench: CanBench, *, as_json: bool) -> int:
    """Quick stop to every drive that is known; nothing but SIGKILL keeps it from its end."""
    for number in ENDS:
        signal.signal(number, signal.SIG_IGN)
    try:
        stopped = stop(bench, draft)
    except DriverError as error:
        stopped = Stopped({}, str(error))
    finally:
        bench.close()
    if as_json:
        told = {"confirmed": stopped.confirmed, "drives": stopped.drives, "words": stopped.words}
        say_json({"stopped": told})
    else:
        say(stopped.words + "\n")
    return 0 if stopped.confirmed else 1


class MotionEnded(KeyboardInterrupt):
    """Ctrl-C, SIGTERM or a terminal that is gone: the dialogue is closed, which ends what it has begun."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.status = 128 + number


@contextmanager
def ending() -> Iterator[None]:
    """Let the first of `ENDS` raise `MotionEnded` within the block, whatever the dialogue does.

    The others change nothing: what ends and confirms a motion is not itself interrupted, and has its time.
    """
    before = {number: signal.signal(number, _end) for number in ENDS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _end(number: int, _frame: FrameType | None) -> None:
    for one in ENDS:
        signal.signal(one, signal.SIG_IGN)
    raise MotionEnded(number)
