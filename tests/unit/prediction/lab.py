"""A store to which predictions and labels of one session come, and a model that has said them."""

import itertools
from collections.abc import Sequence
from typing import Any

from ml.store import Store
from ml.store.labels import Label
from ml.store.tables import LABELS, PREDICTIONS, Table
from tests.unit.ml.serving.small import MS
from tests.unit.prediction.robots import ROBOT, publish

BOOTED_NS = 77 * 10**9  # of the robot's clock, when the session began
SESSION = "20261121T1430"


class Lab:
    """A store with a model, to which predictions and labels come."""

    def __init__(self, url: str, began_ns: int) -> None:
        self.url = url
        self._began_ns = began_ns
        self.store = Store(url)
        self.model = publish(url)
        self._numbers = itertools.count(1)

    def put(self, table: Table, rows: Sequence[dict[str, Any]]) -> None:
        data = table.rows(rows)
        self.store.append(table, table.name, data.schema, data.to_reader, "tests", next(self._numbers))

    def say(self, labels: Sequence[str], begin_ms: int = 0, **other: Any) -> None:
        """A decision every 100 ms from `begin_ms` of the session on."""
        told = {"robot": ROBOT, "session": SESSION, "task": "activity", "model": self.model} | other
        times = [(begin_ms + 100 * at) * MS for at in range(len(labels))]
        self.put(
            PREDICTIONS,
            [
                told | {"utc": self._began_ns + time, "stamp_ns": BOOTED_NS + time, "label": label}
                for time, label in zip(times, labels, strict=True)
            ],
        )

    def label(self, what: str, begin_ms: int, end_ms: int, *, removed: bool = False, **other: Any) -> None:
        spoken = {"robot": ROBOT, "session": SESSION, "label": what, "author": "ada"} | other
        made = Label(
            began_utc_ns=self._began_ns + begin_ms * MS, ended_utc_ns=self._began_ns + end_ms * MS, **spoken
        )
        self.put(LABELS, [made.row(next(self._numbers) * MS, removed=removed)])
