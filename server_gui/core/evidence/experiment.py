"""Record of an A/B trial or a sweep, beside its evidence: periods and results (SI)."""

from msgspec import Struct


class Period(Struct, frozen=True):
    """A value that was held, on the robot's clock; `write` is its number in the robot's journal."""

    value: float
    write: int
    began_ns: int
    ended_ns: int
    cycles: int  # that count, of both legs


class Point(Struct, frozen=True):
    """One value's mean of a metric, with its 95 % interval."""

    value: float
    cycles: int
    mean: float
    low: float
    high: float


class Response(Struct, frozen=True):
    """A metric over the values of a sweep, upwards."""

    series: str
    title: str
    unit: str
    points: tuple[Point, ...]


class Experiment(Struct, frozen=True):
    """`kind` is "A/B trial" or "sweep"; of the first, `seed` has drawn the order of each pair.

    `ended` says why it ended early, empty where it did not; `is_back` whether the device was read to hold the
    original value again. `proposal` is written by nobody but people.
    """

    kind: str
    parameter: str
    unit: str
    original: float
    values: tuple[float, ...]
    cycles: int
    transient: int
    seconds: float | None
    seed: int | None
    periods: tuple[Period, ...]
    ended: str
    is_back: bool
    back: str
    error_bound: float | None = None
    current_bound: float | None = None
    responses: tuple[Response, ...] = ()
    judged_by: str = ""
    proposal: float | None = None
    reason: str = ""
    writes: tuple[int, ...] = ()  # of all its trials, also of those whose period was not whole
