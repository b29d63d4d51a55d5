"""Labels that need not be given one by one: from the simulator's truth, a table, the recording itself."""

import csv
import itertools
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

import numpy as np

from ml.store import Store, StoreError
from ml.store import sessions as stored
from ml.store.labels import INSTANTS, Label, LabelSource, utc_ns
from ml.store.sessions import Session
from ml.training.recorded import Recorded, recorded
from server_gui.core.archive.labelling import BadLabel
from server_gui.core.processing.recording import summarise
from server_gui.core.processing.wiring import Wiring

COLUMNS: Final = ("from", "to", "label")
SIMULATOR: Final = "simulator"
SENSORS: Final = "gait events"


@dataclass(frozen=True, slots=True)
class _Moment:
    """A line of the truth."""

    stamp_ns: int
    label: str
    events: tuple[str, ...]


def from_truth(store: Store, session: Session, path: Path) -> list[Label]:
    """Return a simulated wearer's activities, from the file of `gwrms sim --truth` for this session.

    Raises:
        BadLabel: it is no such file, or of another time, or computer, than the session.
        StoreError: the session's telemetry cannot be read.

    """
    rows = recorded(store, session.robot, session.session, ())
    moments = list(_truth(path))
    inside = [each for each in moments if _within(each.stamp_ns, rows)]
    if not inside:
        raise BadLabel(
            f"{path} tells of nothing in {session.session}: it must be of the same time, and of a simulator "
            "on the robot's own computer, whose clock the stamps are of"
        )
    found = []
    for name, alike in itertools.groupby(inside, key=lambda moment: moment.label):
        group = list(alike)
        following = next((each for each in inside if each.stamp_ns > group[-1].stamp_ns), group[-1])
        found.append((group[0].stamp_ns, following.stamp_ns, name))
    found += [(each.stamp_ns, each.stamp_ns, event) for each in inside for event in each.events]
    lasting = [(begin, end, name) for begin, end, name in found if end > begin or name in INSTANTS]
    return _labels(session, rows, lasting, SIMULATOR, LabelSource.SIMULATOR)


def from_events(store: Store, session: Session) -> list[Label]:
    """Heel strikes and toe offs that insoles, foot IMUs or joints of the recording show.

    Raises:
        BadLabel: they show none.
        StoreError: the session's telemetry cannot be read.

    """
    channels = sorted(Wiring.of([each.name for each in stored.channels(store, session)]).channels)
    rows = recorded(store, session.robot, session.session, channels)
    shown = summarise(rows.stamps_ns, dict(zip(channels, rows.values.T, strict=True)))
    found = [(each.stamp_ns, each.stamp_ns, f"{each.leg}_{each.kind}") for each in shown.events]
    if not found:
        raise BadLabel(f"no foot of {session.session} is seen to step: there is nothing to label")
    return _labels(session, rows, found, SENSORS, LabelSource.SENSORS)


def from_table(
    session: Session, path: Path, author: str, time: Callable[[str], datetime | None]
) -> list[Label]:
    """Return the labels of a CSV file with the columns `from`, `to` and `label`; `to` is empty for instants.

    `time` makes an instant of what stands in a cell, and raises `ValueError`. Raises `BadLabel`.
    """
    found = []
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = csv.DictReader(file)
            missing = set(COLUMNS) - set(lines.fieldnames or ())
            if missing:
                raise BadLabel(
                    f"{path} has no column {', '.join(sorted(missing))}; it needs {','.join(COLUMNS)}"
                )
            for line in lines:
                begin = time(line["from"])
                end = time(line["to"]) if line["to"] else begin
                if begin is None or end is None or not line["label"]:
                    raise ValueError("a time or the label is missing")
                found.append(
                    Label(session.robot, session.session, utc_ns(begin), utc_ns(end), line["label"], author)
                )
    except OSError as error:
        raise BadLabel(f"{path} cannot be read: {error.strerror}") from error
    except (ValueError, csv.Error) as error:
        if isinstance(error, BadLabel):
            raise
        raise BadLabel(f"{path}, line {len(found) + 2}: {error}") from error
    return found


def _truth(path: Path) -> Iterator[_Moment]:
    try:
        with path.open(encoding="utf-8") as lines:
            columns = json.loads(next(lines, "{}")).get("columns", [])
            stamp, label, events = (columns.index(name) for name in ("monotonic_ns", "label", "events"))
            for line in lines:
                if not line.endswith("\n"):
                    return  # it is still being written
                row = json.loads(line)
                yield _Moment(row[stamp], row[label], tuple(row[events]))
    except OSError as error:
        raise BadLabel(f"{path} cannot be read: {error.strerror}") from error
    except (ValueError, AttributeError, IndexError, TypeError) as error:
        raise BadLabel(f"{path} is no truth of gwrms sim: {error}") from error


def _within(stamp_ns: int, rows: Recorded) -> bool:
    return len(rows.stamps_ns) > 0 and bool(rows.stamps_ns[0] <= stamp_ns <= rows.stamps_ns[-1])


def _labels(
    session: Session, rows: Recorded, found: list[tuple[int, int, str]], author: str, source: LabelSource
) -> list[Label]:
    """Stretches of the robot's clock as labels of the session."""
    if not len(rows.stamps_ns):
        raise StoreError(f"the session {session.session} has no telemetry in the store: gwrms cloud upload")
    times = rows.to_utc(np.array([(begin, end) for begin, end, _ in found], np.int64).ravel()).reshape(-1, 2)
    return [
        Label(session.robot, session.session, int(begin), int(end), name, author, source)
        for (begin, end), (_, _, name) in zip(times, found, strict=True)
    ]
