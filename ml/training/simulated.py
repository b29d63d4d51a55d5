"""Sessions of simulated wearers from `gwrms sim-record`, each with its channels and its truth."""

import gzip
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final

import msgspec
import numpy as np
import numpy.typing as npt

from ml.errors import UnusableData
from ml.features.recipe import Features, Recipe, features
from ml.robot.task import Task
from ml.serving.grid import on_grid

Floats = npt.NDArray[np.float64]
TRUTH: Final = ("time", "label", "left_phase", "right_phase")
LOST: Final = frozenset({"fall", "lying", "get_up"})  # in which a phase means nothing
STANDING: Final = "stand"
ORDINARY: Final = "ordinary"  # the walks of recordings that do not say whose they are


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedSession:
    """One wearer's recording: a row for each cycle of the sensors; NaN where a channel has no value."""

    name: str
    subject: str
    channels: tuple[str, ...]
    stamps_ns: npt.NDArray[np.int64]  # (n,) since switching on
    values: Floats  # (n, channels)
    label: npt.NDArray[np.str_]  # (n,)
    phase: Floats  # (n, 2) of the left and the right leg; NaN where it does not step
    walks: str = ORDINARY  # how the wearer walks, as `gwrms sim-record --walks`

    def of(self, channels: tuple[str, ...]) -> Floats:
        """Return the values of these channels, in this order."""
        return self.values[:, [self.channels.index(name) for name in channels]]


@dataclass(frozen=True, slots=True, eq=False)
class Examples:
    """Decisions to learn from or to be judged by; arrays have a row each."""

    features: Features
    label: npt.NDArray[np.str_]  # at the decision's moment less the task's delay
    phase: Floats  # (n, 2)
    subject: npt.NDArray[np.str_]
    time_ns: npt.NDArray[np.int64]
    walks: npt.NDArray[np.str_]


class _Head(msgspec.Struct):
    session: str
    subject: int
    columns: list[str]
    walks: str = ORDINARY


# What reading raises for bytes that are none of ours: also packed ones, numbers too large, lists too deep.
_DAMAGED: Final = (
    ValueError, TypeError, OverflowError, RecursionError, EOFError, gzip.BadGzipFile, zlib.error
)  # fmt: skip
_ROW: Final = msgspec.json.Decoder(list[Any])
_HEAD: Final = msgspec.json.Decoder(_Head)


def read(path: Path) -> list[SimulatedSession]:
    """Return every session of a file.

    Raises:
        UnusableData: it is no such file, or damaged.
        OSError: it cannot be read.

    """
    with path.open("rb") as raw:
        compressed = raw.read(2) == b"\x1f\x8b"
        raw.seek(0)
        with gzip.GzipFile(fileobj=raw) if compressed else raw as file:
            try:
                sessions = [_session(head, rows) for head, rows in _blocks(file)]  # type: ignore[arg-type]
            except _DAMAGED as error:
                raise UnusableData(
                    f"{path} is not what gwrms sim-record writes, or damaged: {error}"
                ) from error
    if not sessions:
        raise UnusableData(f"{path} holds no session of gwrms sim-record")
    return sessions


def examples(task: Task, recipe: Recipe, sessions: list[SimulatedSession], step: int) -> Examples:
    """Return a decision every `step` samples of the recipe's grid, each on a full window.

    Raises:
        UnusableData: a session lacks a channel, or all are shorter than the recipe's look-back.

    """
    parts = [part for session in sessions for part in _decisions(task, recipe, session, step) if len(part[0])]
    if not parts:
        raise UnusableData(f"no session is as long as {recipe.name} looks back")
    columns: list[Any] = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return Examples(*columns)


def stepping(label: npt.NDArray[np.str_], phase: Floats) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Return the targets of gait_phase: phases (n, 2), NaN without steps; and the known rows.

    Between standing and walking, falling and getting up nobody can say.
    """
    steps = ~np.isnan(phase).any(axis=1)
    lost = np.isin(label, list(LOST))
    return phase, ~lost & ~(steps & (label == STANDING))


def _blocks(file: BinaryIO) -> Iterator[tuple[bytes, list[list[Any]]]]:
    head: bytes = b""
    rows: list[list[Any]] = []
    for line in file:
        if line[:1] == b"{":
            if head:
                yield head, rows
            head, rows = line, []
        else:
            rows.append(_ROW.decode(line))
    if head or rows:
        yield head, rows


def _session(line: bytes, rows: list[list[Any]]) -> SimulatedSession:
    head = _HEAD.decode(line)
    if tuple(head.columns[: len(TRUTH)]) != TRUTH:
        raise ValueError(f"the columns of session {head.session} do not begin with {', '.join(TRUTH)}")
    if {len(row) for row in rows} - {len(head.columns)}:
        raise ValueError(f"a line of session {head.session} has not the {len(head.columns)} columns")
    numbers = np.array([[*row[2:]] for row in rows], dtype=np.float64).reshape(len(rows), -1)
    return SimulatedSession(
        head.session,
        str(head.subject),
        tuple(head.columns[len(TRUTH) :]),
        np.array([row[0] for row in rows], dtype=np.int64),
        numbers[:, 2:],
        np.array([row[1] for row in rows], dtype=np.str_),
        numbers[:, :2],
        head.walks,
    )


def _decisions(task: Task, recipe: Recipe, session: SimulatedSession, step: int) -> Iterator[tuple[Any, ...]]:
    missing = set(recipe.channels) - set(session.channels)
    if missing:
        raise UnusableData(f"session {session.name} has no {', '.join(sorted(missing))}")
    for grid_ns, samples in on_grid(recipe, session.stamps_ns, session.of(recipe.channels)):
        ends = np.arange(recipe.look_back - 1, len(samples), step)
        about_ns = grid_ns[ends] - task.delay_ms * 1_000_000
        row = np.clip(np.searchsorted(session.stamps_ns, about_ns, side="right") - 1, 0, None)
        yield (
            features(recipe, samples, ends),
            session.label[row],
            session.phase[row],
            np.full(len(ends), session.subject),
            grid_ns[ends],
            np.full(len(ends), session.walks),
        )
