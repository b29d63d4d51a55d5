"""Models that this computer's collector has adapted to a robot's wearer, polled now and then."""

import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Final, Self

import msgspec

from server_gui.core.desk.station import Station
from server_gui.core.fleet.control_socket import ANSWER_S, NobodyCollects, ask
from server_gui.core.threads.background import Background

LOOK_S: Final = 5.0


class _Link(msgspec.Struct, frozen=True):
    address: str
    calls_itself: str | None = None


class _Predicting(msgspec.Struct, frozen=True):
    adapting: dict[str, str] = {}


class _Report(msgspec.Struct, frozen=True):
    """The needed part of a collector's report."""

    robots: dict[str, _Link] = {}
    prediction: _Predicting | None = None


class Learned:
    """Use it as a context manager, which joins its thread; `look` never waits."""

    def __init__(self, spool: Path, asking: Callable[[Path, str], bytes] = ask) -> None:
        self._spool, self._ask = spool, asking
        self._thread = Background("learned")
        self._looked_s = -LOOK_S
        self._answer: Future[_Report] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self._thread.close(2 * ANSWER_S)

    def look(self, station: Station) -> None:
        """Let the station know what was said last of it; ask again where it is time."""
        answer = self._answer
        if answer is not None and answer.done():
            self._answer = None
            station.predictions.elsewhere = _of(answer.result(), station)
        elif answer is None and time.monotonic() - self._looked_s >= LOOK_S:
            self._looked_s = time.monotonic()
            self._answer = self._thread.do(self._asked)

    def _asked(self) -> _Report:
        """Nothing where nobody records here, or who does is of another version."""
        try:
            return msgspec.json.decode(self._ask(self._spool, "status"), type=_Report)
        except (NobodyCollects, msgspec.DecodeError, OSError):
            return _Report()


def _of(report: _Report, station: Station) -> str:
    """Return the report on this robot, by either name."""
    description = station.robot.description
    calls_itself = None if description is None else description.robot
    for name, link in report.robots.items():
        is_it = link.address == station.address or calls_itself in (link.calls_itself or name,)
        if is_it and report.prediction is not None:
            return report.prediction.adapting.get(name, "")
    return ""
