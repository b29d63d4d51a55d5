"""The end of a command that may have powered a joint: by a signal, or by a stop of every drive."""

import signal
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType

from drivers.errors import DriverError
from gateway.cli.text import say, say_json, table
from gateway.commission.axes import Axis
from gateway.commission.bench import CanBench
from gateway.commission.draft import Draft
from gateway.commission.stopping import Stopped, stop, stop_all
from gateway.config.robot import RobotConfig

NOT_SAID = "not known"  # of a state
ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def stop_drives(draft: Draft, bench: CanBench, *, as_json: bool) -> int:
    """Quick stop to every drive that is known; nothing but SIGKILL keeps it from its end."""
    return _stop(lambda: stop(bench, draft), [bench], as_json=as_json)


def stop_robot(config: RobotConfig, benches: Mapping[str, CanBench], *, as_json: bool) -> int:
    """Quick stop to every joint of a robot's file, each on its own bus; likewise."""
    axes: dict[str, dict[Axis, str]] = {}
    for name, joint in config.joint.items():
        axes.setdefault(joint.bus, {})[Axis(joint.node_id, joint.axis)] = name
    buses = {bus: (benches[bus], found) for bus, found in axes.items()}
    return _stop(lambda: stop_all(buses), benches.values(), as_json=as_json)


def _stop(ask: Callable[[], Stopped], benches: Iterable[CanBench], *, as_json: bool) -> int:
    for number in ENDS:
        signal.signal(number, signal.SIG_IGN)
    try:
        stopped = ask()
    except (DriverError, OSError) as error:
        stopped = Stopped({}, str(error))
    finally:
        for bench in benches:
            bench.close()
    if as_json:
        told = {"confirmed": stopped.confirmed, "drives": stopped.drives, "words": stopped.words}
        proofs = {"states": stopped.states, "after_ms": stopped.after_ms, "joints": stopped.joints}
        say_json({"stopped": {**told, **proofs}})
    else:
        say(stopped.words + "\n" + _drives(stopped))
    return 0 if stopped.confirmed else 1


def _drives(stopped: Stopped) -> str:
    """Return a row a drive: its joint, its state as it has said last, and after how long it confirmed."""
    rows = [
        (stopped.joints.get(drive, ""), drive, stopped.states.get(drive, NOT_SAID), _when(stopped, drive))
        for drive in stopped.drives
    ]
    return table(("JOINT", "DRIVE", "STATE", "CONFIRMED"), rows) if rows else ""


def _when(stopped: Stopped, drive: str) -> str:
    after_ms = stopped.after_ms.get(drive)
    if after_ms is None:
        return f"NOT CONFIRMED: {stopped.drives[drive]}"
    return f"after {max(after_ms, 1.0):.0f} ms"


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
