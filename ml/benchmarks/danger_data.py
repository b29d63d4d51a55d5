"""Recordings for `sim-danger`: simulated dangers with their truth, and how each detector saw them."""

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final

import msgspec
import numpy as np
import numpy.typing as npt

from ml.danger.detector import DETECTORS
from ml.danger.monitor import PERIOD_S, Evidence
from ml.danger.observation import CHANNELS
from ml.errors import UnusableData

Floats = npt.NDArray[np.float64]

HEALTHY: Final = 0.0
OVER: Final = -1.0
LEARNED_S: Final = 60.0  # of each wearer's first time, in which nothing is judged
SUDDEN: Final = frozenset({"encoder_stuck", "torque_off"})  # dangers that nothing shows before
WALKS: Final = frozenset(
    {"walk", "turn_left", "turn_right", "stand"}
)  # healthy walking, and not stairs or a seat

_ROW: Final = msgspec.json.Decoder(list[Any])


class _Head(msgspec.Struct):
    session: str
    subject: int
    columns: list[str]
    dangers: list[str]


_HEAD: Final = msgspec.json.Decoder(_Head)


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """One wearer: a row each moment that was judged."""

    subject: str
    names: tuple[str, ...]  # of dangers
    at_s: Floats  # (n,)
    above: Floats  # (n, detectors), NaN where one says nothing
    danger: Floats  # (n,): HEALTHY, OVER, or a danger's number from 1 on, with .5 more once it has done harm
    label: npt.NDArray[np.str_]

    @property
    def healthy(self) -> npt.NDArray[np.bool_]:
        """Moments in which nothing is wrong, once this wearer is known."""
        own: npt.NDArray[np.bool_] = (self.danger == HEALTHY) & (self.at_s > LEARNED_S)
        return own

    @property
    def coming(self) -> npt.NDArray[np.bool_]:
        """Moments in which a danger has begun and has done no harm yet."""
        own: npt.NDArray[np.bool_] = (self.danger >= 1.0) & (self.danger % 1.0 == 0.0)
        return own

    @property
    def judged(self) -> npt.NDArray[np.bool_]:
        """Moments that count: healthy ones, and those in which a danger comes."""
        own: npt.NDArray[np.bool_] = self.healthy | self.coming
        return own


def read(path: Path) -> list[Seen]:
    """Read the detectors' input of a file of `gwrms sim-record --scenario dangers`.

    Raises:
        UnusableData: it is no such file, or damaged.

    """
    try:
        with path.open("rb") as file:
            found = [_seen(head, rows) for head, rows in _sessions(file)]
    except (ValueError, TypeError, msgspec.DecodeError) as error:
        raise UnusableData(
            f"{path} is not what gwrms sim-record --scenario dangers writes: {error}"
        ) from error
    if len({one.subject for one in found}) < 2:
        raise UnusableData(f"{path} holds fewer than two wearers: nobody is left to be judged by")
    return found


def judgeable(path: Path, seen: Sequence[Seen]) -> tuple[list[Seen], tuple[str, ...]]:
    """Return the wearers who have moments that count, and in words who has none.

    Raises:
        UnusableData: there are fewer than two.

    """
    found = [one for one in seen if one.judged.any()]
    without = [one.subject for one in seen if not one.judged.any()]
    if len(found) < 2:
        raise UnusableData(
            f"{path} holds fewer than two wearers who were recorded beyond their first {LEARNED_S:.0f} s"
        )
    told = f"left out, since nothing of them is recorded beyond the first {LEARNED_S:.0f} s: wearers"
    return found, (f"{told} {', '.join(without)}",) if without else ()


def _sessions(file: BinaryIO) -> Iterator[tuple[_Head, list[list[Any]]]]:
    head: _Head | None = None
    rows: list[list[Any]] = []
    for line in file:
        if line[:1] == b"{":
            if head is not None:
                yield head, rows
            head, rows = _HEAD.decode(line), []
        elif not line.endswith(b"\n"):
            break  # a recording that is still being written
        else:
            rows.append(_ROW.decode(line))
    if head is not None:
        yield head, rows


def _seen(head: _Head, rows: list[list[Any]]) -> Seen:
    columns = [head.columns.index(name) for name in CHANNELS]
    danger_at, every = head.columns.index("danger"), round(PERIOD_S * 100 + 0.5)
    rows = rows[::every]
    values = np.array([[row[at] for at in columns] for row in rows], dtype=np.float64)
    values = values.reshape(-1, len(CHANNELS))
    danger = np.array([row[danger_at] for row in rows])
    at_s = np.array([row[0] for row in rows]) / 1e9
    label = np.array([row[1] for row in rows], dtype=np.str_)
    return Seen(str(head.subject), tuple(head.dangers), at_s, watched(at_s, values, danger), danger, label)


def watched(at_s: Floats, values: Floats, danger: Floats) -> Floats:
    """Return what each detector says, (n, detectors): a danger is met with what was learned before it.

    What comes after harm, of a wearer who lay on the ground, is learned by nobody.
    """
    evidence, before = Evidence(), None
    found = []
    for now, row, danger_now in zip(at_s.tolist(), values, danger.tolist(), strict=True):
        if danger_now >= 1.0 and before is None:
            before = copy.deepcopy(evidence)
        elif danger_now == HEALTHY and before is not None:
            evidence, before = before, None
        found.append(evidence.take(now, row))
    return np.array(found).reshape(-1, len(DETECTORS))
