"""What is recorded of the robots, by whom, and how that goes, in words for the window."""

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from enum import Enum
from typing import Final, Protocol

from gateway.amounts import size
from server_gui.core.fleet.collector import CollectorReport
from server_gui.core.follow.news import News, NewsKind
from server_gui.core.recording.recorder import AlarmKind
from server_gui.core.threads.answers import Deliver, when_done
from server_gui.core.threads.supervision import Trouble

LOOK_NS: Final = 1_000_000_000  # between looks
SOON: Final = "this window records as soon as it can"
WHO: Final = "recording"  # what the news name instead of a robot
STOPPED: Final = frozenset({AlarmKind.DISK_FULL, AlarmKind.SPOOL_FAILED})
NEEDED: Final = frozenset({"network", "recorder"})  # threads without which nothing is recorded
UNKNOWN_NS: Final = 2_000_000_000  # without an answer: nobody knows then


class Keeper(Protocol):
    """Who records: a collector in this process, or one that is asked through its door."""

    def report(self) -> "Future[CollectorReport]":
        """Return how everything goes."""
        ...

    def mark(self, text: str) -> "Future[int]":
        """Mark this instant in the recording of every robot; how many there are."""
        ...

    def upload(self) -> "Future[int]":
        """Bring everything that was recorded until now into the store; how many batches waited."""
        ...


class By(Enum):
    """Who keeps what the robots of this window send."""

    WINDOW = "this window"
    OTHER = "another program"
    NOBODY = "nobody"


class Tone(Enum):
    """How good it is."""

    GOOD = "good"
    WARNING = "warning"
    BAD = "bad"
    OFF = "off"


@dataclass(frozen=True, slots=True)
class Said:
    """One line, and what there is to know and to do about it."""

    tone: Tone
    text: str
    detail: str = ""


class Recording:
    """For the window's thread. `why` says why this window does not record, where it does not."""

    def __init__(self, by: By, keeper: Keeper | None, deliver: Deliver, news: News, why: str = "") -> None:
        self.by = by
        self.why = why
        self.report: CollectorReport | None = None
        self.problem: str | None = None  # why nobody can be asked
        self.on_mark: list[Callable[[str], None]] = []  # told when an instant was marked
        self._keeper = keeper
        self._deliver = deliver
        self._news = news
        self._asked_ns: int | None = None
        self._asking = False
        self._alone_since_ns: int | None = None  # when whoever records elsewhere did not answer any more
        self._trouble: dict[str, str] = {}  # kind → what was told of it
        self._threads: dict[By, tuple[Trouble, ...]] = {}  # by whose they are

    def look(self) -> None:
        """Ask again, now and then."""
        now_ns = time.monotonic_ns()
        due = self._asked_ns is None or now_ns - self._asked_ns >= LOOK_NS
        if self._keeper is None or self._asking or not due:
            return
        self._asked_ns, self._asking = now_ns, True
        keeper = self._keeper
        when_done(
            keeper.report(),
            self._deliver,
            lambda report: self._reported(keeper, report),
            lambda error: self._failed(keeper, error),
        )

    def see(self, threads: Sequence[Trouble], by: By = By.WINDOW) -> None:
        """What is wrong with the threads that follow, record and predict: this window's, or another's."""
        told = {trouble.thread: trouble.text for trouble in self._threads.get(by, ())}
        now = {trouble.thread: trouble.text for trouble in threads}
        for thread, text in now.items():
            if told.get(thread) != text:
                self._news.add(NewsKind.WARNING, WHO, text)
        for thread in told.keys() - now.keys():
            self._news.add(NewsKind.STATE, WHO, f"over: {told[thread]}")
        self._threads[by] = tuple(threads)

    @property
    def can_ask(self) -> bool:
        """Whether there is somebody to mark and upload."""
        return self._keeper is not None and self.problem is None

    def is_alone(self, for_s: float) -> bool:
        """Return whether nobody has recorded for so long, as far as one can ask."""
        since_ns = self._alone_since_ns
        return since_ns is not None and time.monotonic_ns() - since_ns >= for_s * 1e9

    def taken_over(self, keeper: Keeper) -> None:
        """Nobody else records any more, and this window does from now on."""
        self.by, self._keeper, self.why = By.WINDOW, keeper, ""
        self.report, self.problem, self._alone_since_ns, self._asking = None, None, None, False
        self._news.add(NewsKind.STATE, WHO, "nobody else records any more: this window does from now on")

    def mark(self, text: str) -> None:
        """Mark this instant in every robot's recording."""
        for told in self.on_mark if self._keeper is not None else ():
            told(text)
        self._ask(lambda keeper: keeper.mark(text), lambda count: f"marked in {_robots(count)}: {text}")

    def upload(self) -> None:
        """Bring what was recorded until now into the store."""
        self._ask(lambda keeper: keeper.upload(), lambda _: "what was recorded until now goes to the store")

    def said(self, address: str | None) -> Said:
        """Return how it goes, for who looks at the robot with this address."""
        report = self.report
        if self._keeper is None:
            return Said(Tone.OFF, "Not recording", self.why)
        threads = self._threads.get(self.by, ())
        ended = [known.text for known in threads if known.thread in NEEDED and not known.works]
        if ended:
            return Said(Tone.BAD, "RECORDING HAS STOPPED", "; ".join(ended))
        if self.problem is not None:
            return Said(Tone.BAD, "NOT RECORDING", f"{SOON}: {self.why or self.problem}")
        if self._asking and self._asked_ns is not None and time.monotonic_ns() - self._asked_ns > UNKNOWN_NS:
            return Said(Tone.BAD, "RECORDING: NO ANSWER", "whether anything is recorded now is not known")
        if report is None:
            return Said(Tone.OFF, "Recording: not known yet", self.why)
        stopped = [alarm.text for alarm in report.recorder.alarms if alarm.kind in STOPPED]
        if stopped:
            return Said(Tone.BAD, "RECORDING HAS STOPPED", "; ".join(stopped))
        addresses = {link.address for link in report.robots.values()}
        if self.by is By.OTHER and address is not None and address not in addresses:
            return Said(Tone.WARNING, "This robot is NOT recorded", _not_followed(report))
        return self._going_on(report)

    def _going_on(self, report: CollectorReport) -> Said:
        who = "" if self.by is By.WINDOW else f" by process {report.pid}"
        rows = sum(link.rows_per_s for link in report.robots.values())
        problems = [trouble.text for threads in self._threads.values() for trouble in threads]
        problems += [alarm.text for alarm in report.recorder.alarms]
        problems += [] if report.uploader.problem is None else [report.uploader.problem]
        problems += (*report.uploader.lost, *report.uploader.ahead)
        facts = [
            f"Recording{who}",
            f"{rows:.0f} rows/s" if rows else "nothing comes",
            *_queue(report),
            f"{size(report.disk_free_bytes)} free",
        ]
        detail = [*problems, f"spool {report.spool}", f"store {report.store}", self.why]
        return Said(
            Tone.WARNING if problems or not rows else Tone.GOOD,
            " · ".join(facts),
            "\n".join(filter(None, detail)),
        )

    def _reported(self, keeper: Keeper, report: CollectorReport) -> None:
        if keeper is not self._keeper:
            return
        self._asking, self.report, self.problem = False, report, None
        self._alone_since_ns = None
        if self.by is By.OTHER:
            self.see(report.threads, By.OTHER)
        now = {alarm.kind.value: alarm.text for alarm in report.recorder.alarms}
        now |= {} if report.uploader.problem is None else {"store": report.uploader.problem}
        now |= {text: text for text in (*report.uploader.lost, *report.uploader.ahead)}
        for kind in now.keys() - self._trouble.keys():
            self._news.add(NewsKind.WARNING, WHO, now[kind])
        for kind in self._trouble.keys() - now.keys():
            self._news.add(NewsKind.STATE, WHO, f"over: {self._trouble[kind]}")
        self._trouble = now

    def _failed(self, keeper: Keeper, error: Exception) -> None:
        if keeper is not self._keeper:
            return
        self._asking, self.report, self.problem = False, None, str(error)
        if self.by is By.OTHER and self._alone_since_ns is None:
            self._alone_since_ns = time.monotonic_ns()
            self._news.add(NewsKind.WARNING, WHO, f"nobody else records any more; {SOON}")

    def _ask(self, ask: Callable[[Keeper], "Future[int]"], done: Callable[[int], str]) -> None:
        if self._keeper is None:
            self._news.add(NewsKind.WARNING, WHO, f"nobody records: {self.why}")
            return
        when_done(
            ask(self._keeper),
            self._deliver,
            lambda count: self._news.add(NewsKind.STATE, WHO, done(count)),
            lambda error: self._news.add(NewsKind.WARNING, WHO, str(error)),
        )


def _queue(report: CollectorReport) -> list[str]:
    uploader = report.uploader
    spool = f"spool {size(uploader.backlog_bytes)}"
    if uploader.problem is not None:
        return [spool, f"store not reached, {uploader.waiting} to upload"]
    return [spool, f"{uploader.waiting} to upload" if uploader.waiting else "all uploaded"]


def _robots(count: int) -> str:
    return "the recording of 1 robot" if count == 1 else f"the recordings of {count} robots"


def _not_followed(report: CollectorReport) -> str:
    return (
        f"process {report.pid} records into {report.spool}, but does not follow this robot: "
        "add it to [robots] of its server.toml, or end it and open the window again"
    )
