"""What is recorded of the robots, by whom, and how that goes, in words for the window."""

import re
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from datetime import datetime
from enum import Enum
from typing import Final, Protocol

from gateway.amounts import size
from server_gui.core.alarms.alarm import Alarm, Alarms
from server_gui.core.alarms.texts import Kind, check_of
from server_gui.core.cloud.store_reach import AGAIN, StoreReach
from server_gui.core.fleet.collector import CollectorReport
from server_gui.core.fleet.link_statistics import LinkReport
from server_gui.core.follow.frame_time import now_ns
from server_gui.core.follow.news import News, NewsKind
from server_gui.core.recording.recorder import AlarmKind
from server_gui.core.settings.server_file import Upload
from server_gui.core.threads.answers import Deliver, when_done
from server_gui.core.threads.supervision import Trouble

LOOK_NS: Final = 1_000_000_000  # between looks
SOON: Final = "this window records as soon as it can"
WHO: Final = "recording"  # what the news name instead of a robot
SPOOL: Final = "the spool has trouble"
STOPPED: Final = {AlarmKind.DISK_FULL: "the disk is full", AlarmKind.SPOOL_FAILED: SPOOL}
NOBODY: Final = "nobody records"
SHOW_ONLY: Final = "started to show only"
THREAD: Final = "a thread has trouble"
NOT_FOLLOWED: Final = "it is not followed"
NEEDED: Final = frozenset({"network", "recorder"})  # threads without which nothing is recorded
NOTHING: Final = "nothing comes"
LATE_WHY: Final = "this computer is busy"
LATE: Final = f"recording is late: {LATE_WHY}"  # for a moment; all words for it begin alike
CHECK_LATE: Final = "end other programs on this computer"
NO_ROBOT: Final = "No robot to record"
COMES_S: Final = 3.0  # since the newest row: then nothing comes any more
DAMAGED: Final = "gwrms cloud verify says what is missing, gwrms cloud mend brings it again"
NO_FOLDER: Final = "No such file or directory"  # as the system says it
CREATE: Final = "create the folder, or check its mount; what comes until then may be lost"
NOT_REACHED: Final = "store not reached"
AGAIN_SO: Final = r"\1 can be \2 again"
AS_BEFORE: Final = re.compile(r"(.*) cannot be (\w+)\b.*", re.DOTALL)
UNKNOWN_NS: Final = 2_000_000_000  # without an answer: nobody knows then


class Keeper(Protocol):
    """Who records: a collector in this process, or one that is asked through its door."""

    def report(self) -> "Future[CollectorReport]":
        """Return how everything goes."""
        ...

    def mark(self, text: str, ago_s: float = 0.0) -> "Future[int]":
        """Mark this instant, or one before, in the recording of every robot; how many there are."""
        ...

    def upload(self) -> "Future[int]":
        """Bring everything that was recorded until now into the store; how many batches waited."""
        ...


class Pausing(Protocol):
    """A collector of this process, which may pause."""

    def pause(self) -> "Future[None]":
        """End every session, and record nothing until `go_on`."""
        ...

    def go_on(self, name: str, wearer: str | None = None) -> "Future[None]":
        """Begin a session of every robot, with this name, of this wearer; None: of the same as before."""
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
    """One line, and what there is to know and to do about it; `brief` where there is little room."""

    tone: Tone
    text: str
    detail: str = ""
    brief: str = "NOT REC"
    reason: str = ""  # why it is not good, in a few words


class Recording:
    """For the window's thread. `why` says why this window does not record, where it does not."""

    def __init__(
        self,
        by: By,
        keeper: Keeper | None,
        deliver: Deliver,
        news: News,
        why: str = "",
        pausing: Pausing | None = None,
    ) -> None:
        self.by = by
        self.why = why
        self.report: CollectorReport | None = None
        self.problem: str | None = None  # why nobody can be asked
        self.on_mark: list[Callable[[str, float], None]] = []  # told what was marked, and how many s ago
        self.reach = StoreReach()  # of the store; `rely_on` says whose
        self._keeper = keeper
        self._pausing = pausing
        self._alarms = Alarms()
        self._deliver = deliver
        self._news = news
        self._asked_ns: int | None = None
        self._asking = False
        self._alone_since_ns: int | None = None  # when whoever records elsewhere did not answer any more
        self._trouble: dict[str, str] = {}  # kind → what was told of it
        self._since_s: dict[str, float] = {}  # what was told, from when on, on our monotonic clock
        self._stopped = ""  # since when nothing is recorded, and how much is kept
        self._threads: dict[By, tuple[Trouble, ...]] = {}  # by whose they are

    def rely_on(self, reach: StoreReach) -> None:
        """Judge the store by this, which others look at too, and by no other any more. Idempotent."""
        if self._returned in self.reach.on_return:
            if reach is self.reach:
                return
            self.reach.on_return.remove(self._returned)
            self.reach.uploads(None)  # nobody says so any more
        self.reach = reach
        reach.on_return.append(self._returned)

    def look(self) -> None:
        """Ask again, now and then."""
        at_ns = time.monotonic_ns()
        due = self._asked_ns is None or at_ns - self._asked_ns >= LOOK_NS
        if self._keeper is None or self._asking or not due:
            return
        self._asked_ns, self._asking = at_ns, True
        keeper = self._keeper
        when_done(
            keeper.report(),
            self._deliver,
            lambda report: self._reported(keeper, report),
            lambda error: self._failed(keeper, error),
        )

    def see(self, threads: Sequence[Trouble], by: By = By.WINDOW) -> None:
        """Show problems of the threads that follow, record and predict: this window's, or another's."""
        told = {trouble.thread: _told_as(trouble) for trouble in self._threads.get(by, ())}
        now = {trouble.thread: _told_as(trouble) for trouble in threads}
        for thread, text in now.items():
            if told.get(thread) != text:
                self._since_s.pop(told.get(thread, ""), None)
                self._begun(text)
        for thread in told.keys() - now.keys():
            self._over(told[thread])
        self._threads[by] = tuple(threads)

    @property
    def can_ask(self) -> bool:
        """Whether there is somebody to mark and upload."""
        return self._keeper is not None and self.problem is None

    def is_alone(self, for_s: float) -> bool:
        """Return whether nobody has recorded for so long, as far as one can ask."""
        since_ns = self._alone_since_ns
        return since_ns is not None and now_ns() - since_ns >= for_s * 1e9

    def taken_over(self, keeper: Keeper, pausing: Pausing | None = None) -> None:
        """Note that nobody else records any more, and this window does from now on."""
        self.by, self._keeper, self._pausing, self.why = By.WINDOW, keeper, pausing, ""
        self.report, self.problem, self._alone_since_ns, self._asking = None, None, None, False
        self._news.add(NewsKind.STATE, WHO, "nobody else records any more: this window does from now on")

    # --- start and stop

    @property
    def can_pause(self) -> bool:
        """Whether this window records, and so may end that or begin it."""
        return self._pausing is not None and self.report is not None and self.problem is None

    @property
    def is_paused(self) -> bool:
        """Whether somebody has ended it here; robots are followed as before."""
        return self.report is not None and self.report.is_paused

    def pause(self) -> None:
        """End what is recorded now, of every robot."""
        if self._pausing is not None:
            self._stopped = self._kept()
            self._change(self._pausing.pause(), "stopped: what comes now is not kept")

    def _kept(self) -> str:
        now_s, links = time.time(), () if self.report is None else self.report.robots.values()
        begun = [link.recording_since_utc_s for link in links if link.recording_since_utc_s is not None]
        minutes, seconds = divmod(round(now_s - min(begun)) if begun else 0, 60)
        length = f" · {minutes}:{seconds:02} kept" if begun else ""
        return f"since {datetime.fromtimestamp(now_s).astimezone():%H:%M:%S}{length}"

    @property
    def wearer(self) -> str:
        """Whose walks are recorded, or would be; "" where nobody is named, or it is not known."""
        links = () if self.report is None else self.report.robots.values()
        return next((link.wearer for link in links), "")

    def go_on(self, name: str, wearer: str | None = None) -> None:
        """Begin a recording of every robot with this name, of this wearer; None: of the same as before."""
        if self._pausing is not None:
            self._change(self._pausing.go_on(name, wearer), f"started: {name}" if name else "started")

    def link(self, address: str | None) -> LinkReport | None:
        """Return what is known of the recording of the robot with this address."""
        links = () if self.report is None else self.report.robots.values()
        return next((link for link in links if link.address == address), None)

    def _change(self, future: "Future[None]", text: str) -> None:
        def done(_: None) -> None:
            self._news.add(NewsKind.STATE, WHO, text)
            self._asked_ns = None  # how it goes now is asked at once

        when_done(
            future, self._deliver, done, lambda error: self._news.add(NewsKind.WARNING, WHO, str(error))
        )

    def mark(self, text: str, ago_s: float = 0.0) -> None:
        """Mark this instant, or the one `ago_s` before it, in every robot's recording."""
        if self.is_paused:
            self._news.add(NewsKind.WARNING, WHO, "not marked: nothing is recorded, it was stopped here")
            return
        for told in self.on_mark if self._keeper is not None else ():
            told(text, ago_s)
        none = "no recording goes on since then" if ago_s else "nothing is recorded"
        self._ask(
            lambda keeper: keeper.mark(text, ago_s),
            lambda count: (
                (NewsKind.STATE, f"marked in {_robots(count)}: {text}")
                if count
                else (NewsKind.WARNING, f"NOT marked, {none}: {text}")
            ),
        )

    def upload(self) -> None:
        """Bring what was recorded until now into the store."""
        self._ask(lambda keeper: keeper.upload(), lambda _: (NewsKind.STATE, self._uploading()))

    def _uploading(self) -> str:
        """Return what becomes of what was recorded until now, as far as the store is reached."""
        if self.reach.problem is not None:
            return f"what was recorded until now waits for the store: it is not reached, {AGAIN}"
        if self.reach.upload_problem is not None:
            return f"what was recorded until now waits for the store: an upload failed, {AGAIN}"
        return "what was recorded until now goes to the store"

    @property
    def alarms(self) -> Alarms:
        """What keeps rows from being kept, or from the store, as of now."""
        self._alarms.look(self._found(), time.time())
        return self._alarms

    def _found(self) -> Iterator[Alarm]:
        said, report = self.said(None), self.report
        if said.tone is Tone.BAD:
            what = said.detail or said.text
            check = CREATE if NO_FOLDER in what else check_of(Kind.NOT_RECORDED)
            yield Alarm(Kind.NOT_RECORDED, "", what, check=check)
        if said.detail == LATE:
            yield Alarm(Kind.RECORDING, "late", LATE_WHY, "recorder", check=CHECK_LATE)
        if self.reach.trouble is not None:
            yield Alarm(Kind.UPLOAD, "", self.reach.trouble, check=check_of(Kind.UPLOAD))
        if report is None:
            return
        for one in report.recorder.alarms:
            if one.kind not in STOPPED:
                where, check = "recorder", check_of(Kind.RECORDING)
                yield Alarm(Kind.RECORDING, one.kind.value, one.text, where, check=check)
        for text in (*report.uploader.lost, *report.uploader.ahead):
            yield Alarm(Kind.UPLOAD, text, text, "what is kept", check=DAMAGED)

    def said(self, address: str | None, *, is_live: bool = True) -> Said:
        """Return how it goes, for who looks at the robot with this address, or at none.

        A report is a second old; whether this window's own link `is_live` is known at once.
        """
        report = self.report
        if self._keeper is None:
            return Said(Tone.OFF, "Not recording", self.why, "REC off", self._why_not(self.why))
        threads = self._threads.get(self.by, ())
        ended = [known for known in threads if known.thread in NEEDED and not known.works]
        if ended and all(known.is_late for known in ended):
            return Said(Tone.WARNING, LATE.partition(":")[0].capitalize(), LATE, "REC late", LATE_WHY)
        if ended:
            return Said(
                Tone.BAD, "RECORDING HAS STOPPED", "; ".join(known.text for known in ended), reason=THREAD
            )
        if self.problem is not None:
            detail = f"{self.why or self.problem}; {SOON}"
            return Said(Tone.BAD, "NOT RECORDING", detail, reason=self._why_not(detail))
        if self._asking and self._asked_ns is not None and now_ns() - self._asked_ns > UNKNOWN_NS:
            unknown = "whether anything is recorded now is not known"
            return Said(Tone.BAD, "RECORDING: NO ANSWER", unknown, "REC ?", "not known whether")
        if report is None:
            return Said(Tone.OFF, "Recording: not known yet", self.why, "REC ?", "waits for an answer")
        stopped = [alarm for alarm in report.recorder.alarms if alarm.kind in STOPPED]
        if stopped:
            texts = "; ".join(alarm.text for alarm in stopped)
            return Said(Tone.BAD, "RECORDING HAS STOPPED", texts, reason=STOPPED[stopped[0].kind])
        if report.is_paused:
            return Said(
                Tone.OFF,
                " · ".join(filter(None, ("Not recording: stopped", self._stopped))),
                "somebody has stopped it in this window",
                "REC off",
                "" if self._stopped else "stopped here",
            )
        addresses = {link.address for link in report.robots.values()}
        if self.by is By.OTHER and address is not None and address not in addresses:
            return Said(
                Tone.WARNING, "This robot is NOT recorded", _not_followed(report), reason=NOT_FOLLOWED
            )
        return self._going_on(report, address, comes=is_live or self.by is not By.WINDOW)

    def _why_not(self, detail: str) -> str:
        """Return in a few words why nothing is recorded, told by all of them."""
        if NO_FOLDER in detail:
            return "its folder is missing"
        if self._keeper is None:
            return SHOW_ONLY if SHOW_ONLY in detail else NOBODY
        return NOBODY if self.by is By.OTHER else "the recorder failed"

    def _going_on(self, report: CollectorReport, address: str | None, *, comes: bool) -> Said:
        if address is None and not comes:
            return Said(Tone.OFF, NO_ROBOT, f"spool {report.spool}", "REC off", "none is followed")
        who = "" if self.by is By.WINDOW else f" by process {report.pid}"
        rows = sum(link.rows_per_s for link in report.robots.values())
        problems = [trouble.text for threads in self._threads.values() for trouble in threads]
        problems += [alarm.text for alarm in report.recorder.alarms]
        problems += [] if self.reach.trouble is None else [self.reach.trouble]
        problems += (*report.uploader.lost, *report.uploader.ahead)
        facts = [
            f"Recording{who}",
            _coming(rows, [link for link in report.robots.values() if address in (None, link.address)])
            if comes
            else NOTHING,
            *_queue(report, is_reached=self.reach.problem is None and self.reach.upload_problem is None),
            f"{size(report.disk_free_bytes)} free",
        ]
        detail = [*problems, f"spool {report.spool}", f"store {report.store}", self.why]
        return Said(
            Tone.WARNING if problems or facts[1] == NOTHING else Tone.GOOD,
            " · ".join(facts),
            "\n".join(filter(None, detail)),
            "REC",
            self._reason(report),
        )

    def _reason(self, report: CollectorReport) -> str:
        """Return why it is a warning, in a few words; "" where what is said of the rows tells that."""
        reach, recorder = self.reach, report.recorder
        known = (
            (bool(recorder.alarms), SPOOL),
            (reach.problem is not None, NOT_REACHED),
            (reach.list_problem is not None, "store's list damaged"),
            (reach.upload_problem is not None, "an upload failed"),
            (bool(report.uploader.lost or report.uploader.ahead), "the spool has losses"),
            (any(self._threads.values()), THREAD),
        )
        return next((text for is_so, text in known if is_so), "")

    def _reported(self, keeper: Keeper, report: CollectorReport) -> None:
        if keeper is not self._keeper:
            return
        self._asking, self.report, self.problem = False, report, None
        self._alone_since_ns = None
        self.reach.uploads(report.uploader.problem)
        if self.by is By.OTHER:
            self.see(report.threads, By.OTHER)
        now = {alarm.kind.value: alarm.text for alarm in report.recorder.alarms}
        now |= {} if self.reach.trouble is None else {"store": self.reach.trouble}
        now |= {text: text for text in (*report.uploader.lost, *report.uploader.ahead)}
        for kind in now.keys() - self._trouble.keys():
            self._begun(now[kind])
        for kind in self._trouble.keys() - now.keys():
            self._over(self._trouble[kind])
        self._trouble = now

    def _begun(self, text: str) -> None:
        self._since_s[text] = time.monotonic()
        self._news.add(NewsKind.WARNING, WHO, text)

    def _over(self, text: str) -> None:
        """Tell that a trouble is over, and how it is again."""
        since_s = self._since_s.pop(text, None)
        after = "" if since_s is None else f" after {max(1.0, time.monotonic() - since_s):.0f} s"
        self._news.add(NewsKind.STATE, WHO, f"trouble ended{after}: {AS_BEFORE.sub(AGAIN_SO, text)}")

    def _failed(self, keeper: Keeper, error: Exception) -> None:
        if keeper is not self._keeper:
            return
        self._asking, self.report, self.problem = False, None, str(error)
        self.reach.uploads(None)  # nobody says so any more
        if self.by is By.OTHER and self._alone_since_ns is None:
            self._alone_since_ns = time.monotonic_ns()
            self._news.add(NewsKind.WARNING, WHO, f"nobody else records any more; {SOON}")

    def _returned(self) -> None:
        """Send what waits now that the store is back, not when the next attempt would be due."""
        report = self.report
        if self._keeper is None or report is None or report.upload is not Upload.ALWAYS:
            return
        if report.uploader.problem is not None:  # whether it helps, the next report says
            said = NewsKind.STATE, "the store is back: what waits goes there"
            self._ask(lambda keeper: keeper.upload(), lambda _: said)

    def _ask(
        self, ask: Callable[[Keeper], "Future[int]"], done: Callable[[int], tuple[NewsKind, str]]
    ) -> None:
        if self._keeper is None:
            self._news.add(NewsKind.WARNING, WHO, f"nobody records: {self.why}")
            return
        when_done(
            ask(self._keeper),
            self._deliver,
            lambda count: self._tell(*done(count)),
            lambda error: self._tell(NewsKind.WARNING, str(error)),
        )

    def _tell(self, kind: NewsKind, text: str) -> None:
        self._news.add(kind, WHO, text)


def _told_as(trouble: Trouble) -> str:
    """Return a thread's trouble as the window says it everywhere."""
    return LATE if trouble.is_late and trouble.thread in NEEDED else trouble.text


def _queue(report: CollectorReport, *, is_reached: bool) -> list[str]:
    """Return what is on this computer alone, with the newest rows, which are no batch yet."""
    pending = report.uploader.backlog_bytes
    to_upload = f"{size(pending)} to upload"
    if not is_reached:
        return [f"{NOT_REACHED}, {to_upload if pending else 'nothing to upload'}"]
    return [to_upload if pending else "all uploaded"]


def _coming(rows_per_s: float, links: Sequence[LinkReport]) -> str:
    """By the newest row: a rate over seconds is 0 at the beginning, and goes on for a while at the end."""
    ages_s = [link.newest_age_s for link in links if link.newest_age_s is not None]
    if not ages_s or min(ages_s) > COMES_S:
        return NOTHING
    return f"{rows_per_s:.0f} rows/s" if rows_per_s else "rows come"


def _robots(count: int) -> str:
    return "the recording of 1 robot" if count == 1 else f"the recordings of {count} robots"


def _not_followed(report: CollectorReport) -> str:
    return (
        f"process {report.pid} records into {report.spool}, but does not follow this robot: "
        "add it to [robots] of its server.toml, or end it and open the window again"
    )
