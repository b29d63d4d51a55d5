"""The whole of one recording at a glance: the least and the most of its knees in each short stretch of it."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any, Final

import numpy as np

from server_gui.core.cloud.tape import Rows, Tape
from server_gui.core.recording.rows import Floats
from server_gui.core.threads.answers import Deliver, when_done

PIECE_NS: Final = 300_000_000_000  # read at once, as playing waits for it; more of a recording of days
STRETCHES: Final = 300  # of a recording: of a short one each has rows still
SHOWN: Final = ("knee.position", "hip.position", "ankle.position", ".position", ".force")


class Outline:
    """For the window's thread; `read` does what it is given in another one. NaN where nothing was recorded.

    It is a picture and no measurement: it ends where it cannot be read, and playing it says why.
    """

    def __init__(self, read: Callable[[Callable[[], Any]], "Future[Any]"], deliver: Deliver) -> None:
        self.revision = 0  # rises with each change
        self.least: dict[str, Floats] = {}  # by channel, a value a stretch
        self.most: dict[str, Floats] = {}
        self.read_share = 0.0  # of the recording, from its beginning; what comes after is not known
        self._read = read
        self._deliver = deliver

    def open(self, tape: Tape) -> None:
        """Find out of another recording, or of the same one anew."""
        names = shown([*tape.units])
        self.least = {name: np.full(STRETCHES, np.nan) for name in names}
        self.most = {name: np.full(STRETCHES, np.nan) for name in names}
        self.read_share = 0.0
        self.revision += 1
        self._look(tape, tape.first_ns)

    def _look(self, tape: Tape, begin_ns: int) -> None:
        least = self.least
        if not least or begin_ns > tape.last_ns:
            return
        end_ns = begin_ns + max(PIECE_NS, (tape.last_ns - tape.first_ns) // STRETCHES)
        when_done(
            self._read(lambda: tape.read(begin_ns, end_ns, [*least])),
            self._deliver,
            lambda rows: self._looked(tape, end_ns, rows) if least is self.least else None,
            lambda _error: None,
        )

    def _looked(self, tape: Tape, end_ns: int, rows: Rows) -> None:
        places = (rows.utc_ns - tape.first_ns) * STRETCHES // (tape.last_ns - tape.first_ns + 1)
        places = np.clip(places, 0, STRETCHES - 1)  # a row that came meanwhile belongs to the end
        for name, column in rows.columns.items():
            known = np.where(np.isfinite(column), column, np.nan)  # beside an infinity all else were flat
            np.fmin.at(self.least[name], places, known)
            np.fmax.at(self.most[name], places, known)
        self.read_share = min((end_ns - tape.first_ns) / (tape.last_ns - tape.first_ns + 1), 1.0)
        self.revision += 1
        self._look(tape, end_ns)


def shown(names: Sequence[str]) -> list[str]:
    """Return the channels that show best what went on: a pair where there is one."""
    for quantity in SHOWN:
        if found := [name for name in names if name.endswith(quantity)]:
            return found[:2]
    return []
