"""`gwrms sessions gait`: how somebody walked in a recording, by the same code as live."""

import math
from collections.abc import Iterator, Mapping

import numpy as np
import pyarrow as pa

from gateway.amounts import NONE
from gateway.cli.text import say, say_json, table
from server_gui.cli.cloud_options import (
    absolute,
    add_url,
    instant_or_seconds,
    parser,
    progress,
    recordings,
)
from server_gui.core.processing.gait_events import Leg
from server_gui.core.processing.gait_measures import LegGait
from server_gui.core.processing.joint_measures import Error
from server_gui.core.processing.recording import RecordedGait, summarise
from server_gui.core.processing.wiring import Wiring

EPILOG = """Means over all complete strides; gwrms docs processing has the sources of events, and every
formula. A minute of recording takes a quarter of a second.

example
  gwrms sessions gait 20261121T1530 --from 10 --to 70"""
ERRORS = ("JOINT", "TRACKING ERROR (RMS)", "LARGEST", "")
LEGS = ("LEG", "STRIDES", "STRIDE", "STEP", "STANCE", "SWING", "VARIABILITY")


def gait(argv: list[str]) -> int:
    """Run `gwrms sessions gait`."""
    made = parser(
        "sessions gait", "Show cadence, step times, symmetry and ranges of motion of a recording.", EPILOG
    )
    made.add_argument("session", metavar="SESSION", help="its name, which may be abbreviated")
    meaning = "a time (UTC), or seconds since the session's first sample"
    made.add_argument("--from", dest="begin", type=instant_or_seconds, metavar="TIME", help=meaning)
    made.add_argument("--to", dest="end", type=instant_or_seconds, metavar="TIME", help=meaning)
    add_url(made)
    arguments = made.parse_args(argv)
    known = recordings("sessions", arguments)
    recorded = known.open(known.find(arguments.session))
    session = recorded.session
    names = sorted(Wiring.of([each.name for each in recorded.channels]).channels)
    begin, end = absolute(session, arguments.begin), absolute(session, arguments.end)
    parts: list[pa.Table] = []
    with progress("rows", session.rows) as advance:
        for part in recorded.telemetry(names, begin, end):
            parts.append(part)
            advance(part.num_rows)
    found = _summary(parts, names, recorded.enabled)
    if arguments.json:
        say_json({"gait": found.gait, "errors": found.errors, "events": len(found.events)})
    else:
        say("\n".join(_told(found)) + "\n")
    return 0


def _summary(
    parts: list[pa.Table], names: list[str], enabled: Mapping[str, frozenset[float]]
) -> RecordedGait:
    if not parts:
        return summarise(np.empty(0, np.int64), {})
    rows = pa.concat_tables(parts)
    return summarise(rows["stamp_ns"].to_numpy(), {name: rows[name].to_numpy() for name in names}, enabled)


def _told(found: RecordedGait) -> Iterator[str]:
    walk = found.gait
    if not found.strides:
        yield "no stride was found: is there an insole, a foot IMU, or hips, knees and trunk in it?"
    else:
        cadence, both = _number(walk.cadence_spm, 1), _share(walk.double_support)
        yield f"cadence {cadence} steps a minute, double support {both}"
        yield table(LEGS, [_leg(leg, walk.legs[leg]) for leg in Leg], right=range(1, len(LEGS)))
        uneven = ", ".join(
            f"{name.removesuffix('_s')} {_number(value, 3)}" for name, value in walk.symmetry.items()
        )
        yield f"symmetry (left − right, 0 is even): {uneven}"
    ranges = [(joint, f"{math.degrees(angle):.1f}°") for joint, angle in sorted(walk.ranges.items())]
    if ranges:
        yield "\n" + table(("JOINT", "RANGE OF MOTION"), ranges, right=(1,)).rstrip("\n")
    if found.errors:
        rows = [(joint, *_error(error)) for joint, error in sorted(found.errors.items())]
        yield "\n" + table(ERRORS, rows, right=(1, 2)).rstrip("\n")


def _error(error: Error | None) -> tuple[str, str, str]:
    if error is None:
        return NONE, NONE, "no value while its drive was enabled"
    rms, largest = (f"{math.degrees(angle):.2f}°" for angle in (error.rms, error.largest))
    return (
        rms,
        largest,
        "" if error.while_enabled else "at all times: its drive's state was not recorded",
    )


def _leg(leg: Leg, found: LegGait) -> tuple[str, ...]:
    times = (f"{_number(value, 3)} s" for value in (found.stride_s, found.step_s))
    shares = (_share(value) for value in (found.stance, found.swing, found.variability))
    return (leg.value, str(found.strides), *times, *shares)


def _number(value: float | None, digits: int) -> str:
    return NONE if value is None else f"{value:.{digits}f}"


def _share(value: float | None) -> str:
    return NONE if value is None else f"{100 * value:.1f} %"
