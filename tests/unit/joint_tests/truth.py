"""A recording of the simulator's own mechanics, cycle by cycle in simulated time: its truth is known."""

from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from gateway.joint_test.motion import Wish, motion
from server_gui.core.joint_tests.file import FORMAT, Ended, Head, Test
from tests.unit.hil_sim.bench import Bench
from tests.unit.hil_sim.driving import COUNTS_PER_RADIAN, CSP, CST, enable_in

PERIOD_S = 0.01
RATED_NM = 40.0
COLUMNS = ["sync_ns", "position_ns", "target", "position", "velocity", "torque", "current", "statusword"]


def recorded(bench: Bench, wish: Wish) -> Test:
    """What `gwrms joint-test` would record of this drive, were its cycles never late."""
    by_torque = wish.kind.by_torque
    enable_in(bench, CST if by_torque else CSP)
    start = bench.drive.servo.position
    targets = motion(wish, PERIOD_S)
    target = next(targets)
    rows = []
    began_ns = bench.clock.now_ns
    for cycle in range(1_000_000):
        bench.clock.run_until(began_ns + cycle * round(PERIOD_S * 1e9))
        index, counts = 0x607A, (start + target) * COUNTS_PER_RADIAN
        if by_torque:
            index, counts = 0x6071, target / RATED_NM * 1000
        entry = bench.drive.dictionary[index, 0]
        entry.value = round(counts)
        assert entry.on_write is not None
        entry.on_write(0)
        bench.drive.advance()
        servo, now_ns = bench.drive.servo, bench.clock.now_ns
        position = round(servo.position * COUNTS_PER_RADIAN) / COUNTS_PER_RADIAN
        torque = round(1000 * servo.torque / RATED_NM) / 1000 * RATED_NM
        aimed = target if by_torque else start + target
        rows.append((now_ns, now_ns, aimed, position, servo.velocity, torque, torque / 8, 0x27))
        bench.drive._on_sync()
        try:
            target = targets.send(position - start)
        except StopIteration:
            break
    return made(np.array(rows), wish)


def made(rows: NDArray[np.float64], wish: Wish, **head: object) -> Test:
    """A recording of these rows, each of `COLUMNS`."""
    told = {
        "format": FORMAT,
        "robot": "bench",
        "joint": "left_knee",
        "test": str(wish.kind),
        "began": "2026-11-23T10:00:00Z",
        "who": "Ada",
        "wish": {name: getattr(wish, name) for name in wish.__slots__},
        "limits": {},
        "period_s": PERIOD_S,
        "angle": 0.0,
        "drive": {"gear_ratio": 100.0},
        "guard": [],
        "parameters": {"0x2030:1": 3000},
        "columns": COLUMNS,
        "units": [""] * len(COLUMNS),
        **head,
    }
    columns = {name: rows[:, at] for at, name in enumerate(COLUMNS)}
    return Test(
        Path("test.jsonl"), msgspec.convert(told, Head), columns, Ended(None, True, "switch on disabled")
    )


def sampled(
    times: NDArray[np.float64], target: NDArray[np.float64], position: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Rows of a joint without anything but these two."""
    rows = np.zeros((len(times), len(COLUMNS)))
    rows[:, 0] = rows[:, 1] = times * 1e9
    rows[:, 2], rows[:, 3] = target, position
    return rows
