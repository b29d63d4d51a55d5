"""The server without a screen: fleet, recorder, spool, uploader, and the door where it is asked."""

import asyncio
import concurrent.futures
import functools
import importlib.metadata
import logging
import os
import shutil
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Final, Self, TypeVar

import msgspec
from msgspec import Struct

from gateway.client import Address
from gateway.wire.resource import ResourceSnapshotParams
from ml.store import Store
from server_gui.core.evidence.file import folder_beside
from server_gui.core.evidence.service import EvidenceService
from server_gui.core.evidence.service import Tell as TellEvidence
from server_gui.core.fleet.control_socket import Answers, door
from server_gui.core.fleet.fleet import Fleet, Subscriber
from server_gui.core.fleet.link_statistics import LinkReport
from server_gui.core.fleet.live_prediction import RecordedPrediction, TellPredictions
from server_gui.core.fleet.stop_links import StopLinks, StopRobot
from server_gui.core.follow.feed import ONCE, FollowSettings
from server_gui.core.follow.network import Network
from server_gui.core.prediction.adaptation import Happening
from server_gui.core.prediction.news import PredictionNews
from server_gui.core.prediction.state import PredictingState
from server_gui.core.recording.compaction import Compaction
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.recorder import Recorder, RecorderSettings, RecorderState
from server_gui.core.recording.records import NOBODY, Worn
from server_gui.core.recording.rows import Record
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.uploader import Uploader, UploaderState
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings, Upload
from server_gui.core.threads.supervision import ThreadWatch, Trouble

log = logging.getLogger(__name__)

Result = TypeVar("Result")

QUIET_S: Final = 10.0  # without a row of any robot: idle
MOST_BACKLOG_BYTES: Final = 2 << 30  # more does not wait until the robots are quiet
JOURNAL_S: Final = 5.0
ON_DISK_S: Final = 4.0  # for what was asked to be kept
LAST_UPLOAD_S: Final = 20.0  # what waits at the end may take so long; the spool keeps the rest
BREAK_OFF_S: Final = 5.0  # for an upload under way
HURRIED_S: Final = 0.3  # likewise, where nobody waits


class Note(Struct, frozen=True):
    """A mark of an instant that was `ago_s` before."""

    text: str
    ago_s: float


class CollectorReport(Struct, frozen=True):
    """Everything that `gwrms collect --status` tells; seconds, UTC."""

    version: str
    pid: int
    began_utc_s: float
    spool: str
    store: str
    upload: Upload
    disk_free_bytes: int  # of the spool's disk
    robots: dict[str, LinkReport]
    recorder: RecorderState
    uploader: UploaderState
    prediction: PredictingState | None = None  # None: it is off
    threads: tuple[Trouble, ...] = ()  # of its own, that have died or stand still
    is_paused: bool = False  # robots are followed, but nothing is recorded


class Collector:
    """Records from entering to leaving; use it as a context manager, which ends every thread.

    Leaving ends the sessions, and uploads what waits, for a while: what is not in the store then stays in the
    spool. Where an upload hangs even so, `hangs` is set, and only the end of the process ends its thread.
    A window records with a `following` of its own; its `subscribers` are told of everything after it is
    recorded. `tell_predictions` and `tell_evidence` are called in other threads; `stop` stops a robot where a
    rule wants it.
    """

    def __init__(
        self,
        settings: ServerSettings,
        operator: str = "",
        notes: str = "",
        following: FollowSettings | None = None,
        subscribers: Iterable[Subscriber] = (),
        tell_predictions: TellPredictions | None = None,
        stop: StopRobot | None = None,
        worn: Worn = NOBODY,
        tell_evidence: TellEvidence | None = None,
    ) -> None:
        self.hangs = self._hurries = False
        self.ends = ""  # what it waits for while it is left
        self._disk = concurrent.futures.ThreadPoolExecutor(1, "disk")
        self._settings = settings
        self._began_s = time.time()
        recorder = settings.recorder
        self._spool = Spool(recorder.spool)
        self.network = Network()
        store, every_s = settings.store, settings.store.compact_s
        compacting = None if every_s is None else Compaction(store.url, self._spool.folder, every_s)
        self._uploader = Uploader(self._spool, lambda: connect(store), self._wanted, compacting)
        self._recorder = Recorder(self._spool, settings=RecorderSettings(batch_s=recorder.batch_s))
        asked = msgspec.structs.replace(following or whole(recorder), identities=True)
        self._fleet = Fleet(asked, self._recorder, operator, notes, worn)
        self._stop_links = StopLinks(self.network, settings.rules if stop is None else ())
        self._evidence = EvidenceService(folder_beside(recorder.spool), self._fleet.session, tell_evidence)
        self._prediction = (
            RecordedPrediction(
                settings,
                self._recorder,
                self._fleet.session,
                stop or self._stop_links.stop,
                functools.partial(_tell_all, (self._evidence.predicted, tell_predictions)),
                None if tell_predictions is None else self._fleet.wearing,  # whom could it be offered?
            )
            if settings.prediction.enabled
            else None
        )
        if self._prediction is not None:
            self._fleet.subscribers.append(self._prediction.take)
        self._fleet.subscribers.append(self._evidence.take)
        self._fleet.subscribers.extend(subscribers)
        self._running: concurrent.futures.Future[None] | None = None
        predicting = () if self._prediction is None else self._prediction.workers
        own = (self.network.worker, self._recorder.worker, self._uploader.worker, self._evidence.worker)
        self.watch = ThreadWatch((*own, *predicting))

    def __enter__(self) -> Self:
        self._uploader.__enter__()
        self._recorder.__enter__()
        self._evidence.__enter__()
        self.network.__enter__()
        if self._prediction is not None:
            self._prediction.__enter__()
        self._running = self.network.run(self._run())
        return self

    def __exit__(self, *exc: object) -> None:
        self.ends = "what came last goes to the disk"
        if self._prediction is not None:
            self._prediction.__exit__()
        self.network.__exit__()
        self._evidence.__exit__()
        self._disk.shutdown()
        self._recorder.close()
        self._upload_last()
        self.hangs = not self._uploader.close(HURRIED_S if self._hurries else BREAK_OFF_S)
        self._spool.close()

    def hurry(self) -> None:
        """Leave without the last upload, from any thread: all that was recorded is in the spool."""
        self._hurries = True
        self._uploader.hurry()

    def _upload_last(self) -> None:
        waiting = len(self._spool.waiting())
        self.ends = f"{waiting} {'batch' if waiting == 1 else 'batches'} of the recording go to the store"
        if self._settings.recorder.upload is not Upload.MANUAL and not self._uploader.drain(LAST_UPLOAD_S):
            log.warning("%d batches wait in the spool for the next start", len(self._spool.waiting()))

    @property
    def untold(self) -> int:
        """Number of lost rows without an event; for its end."""
        return self._recorder.untold

    def wait(self, within_s: float) -> None:
        """Let it work so long, and see to its threads; raises what has ended it, a mistake of ours."""
        self.watch.look()
        self._stop_links.look()
        if self._running is not None and concurrent.futures.wait([self._running], within_s).done:
            self._running.result()

    def report(self) -> "concurrent.futures.Future[CollectorReport]":
        """Return how everything goes now."""
        return self._do(lambda: self._report(""))

    def follow(self, robot: str, address: Address) -> "concurrent.futures.Future[None]":
        """Follow another robot from now on."""
        return self._do(lambda: self._follow(robot, address))

    def leave(self, robot: str) -> "concurrent.futures.Future[None]":
        """Follow a robot no more; its recording ends."""
        return self._do(lambda: self._fleet.leave(robot))

    def mark(self, text: str, ago_s: float = 0.0) -> "concurrent.futures.Future[int]":
        """Mark this instant, or one before, where it was recorded then; in how many it is on the disk."""
        return self.network.run(self._mark(text, ago_s))

    def upload(self) -> "concurrent.futures.Future[int]":
        """Bring everything that was recorded until now into the store; how many batches waited."""
        return self._do(lambda: self._upload(""))

    def adapt(self, robot: str, number: int, what: Happening) -> None:
        """Say what becomes of what was learned from the wearer; from any thread."""
        if self._prediction is not None:
            self._prediction.say(robot, number, what)

    def pause(self) -> "concurrent.futures.Future[None]":
        """End every session, and record nothing until `go_on`."""
        return self._do(self._fleet.pause)

    def go_on(self, name: str, wearer: str | None = None) -> "concurrent.futures.Future[None]":
        """Begin a session of every robot, with this name, of this wearer; None: of the same as before."""
        return self._do(lambda: self._fleet.go_on(name, wearer))

    def _do(self, what: Callable[[], Result]) -> "concurrent.futures.Future[Result]":
        """In the network's thread."""

        async def do() -> Result:
            return what()

        return self.network.run(do())

    def _follow(self, robot: str, address: Address) -> None:
        self._fleet.follow(robot, address)
        self._stop_links.follow(robot, address)

    async def _run(self) -> None:
        answers: Answers = {
            "status": self._report,
            "upload": self._upload,
            "mark": self._mark,
            "note": self._note,
            "keep": self._keep,
        }
        for name, robot in self._settings.robots.items():
            self._follow(name, robot.where)
        async with door(self._spool.folder, answers):
            await self._fleet.run()

    def _wanted(self) -> bool:
        """Return whether the next batch may go to the store now."""
        match self._settings.recorder.upload:
            case Upload.ALWAYS:
                return True
            case Upload.MANUAL:
                return False
            case Upload.IDLE:
                newest_ns = self._fleet.newest_ns
                quiet = newest_ns is None or time.monotonic_ns() - newest_ns > QUIET_S * 1e9
                return quiet or self._uploader.state.backlog_bytes > MOST_BACKLOG_BYTES

    async def _note(self, text: str) -> int:
        note = msgspec.json.decode(text, type=Note)
        return await self._mark(note.text, note.ago_s)

    async def _mark(self, text: str, ago_s: float = 0.0) -> int:
        lost = self._recorder.state.lost
        robots = self._fleet.recorded(time.time() - ago_s if ago_s else None)
        for name in robots:
            self._recorder.mark(name, text, ago_s)
        return len(robots) if await self._on_disk(lost) else 0

    async def _keep(self, text: str) -> bool:
        """Keep rows of other tables, such as labels; whether they are on the disk now."""
        rows = msgspec.json.decode(text, type=list[Record])
        lost = self._recorder.state.lost
        for row in rows:
            self._recorder.add(row)
        return await self._on_disk(lost)

    async def _on_disk(self, lost: int) -> bool:
        """Return whether everything until now is safe, if so many rows had been lost before."""
        flushed = self._disk.submit(self._recorder.flush, ON_DISK_S)
        return await asyncio.wrap_future(flushed) and self._recorder.state.lost == lost

    def _upload(self, _text: str) -> int:
        """Begin to upload everything until now; how many batches waited."""
        self._recorder.cut(self._uploader.now)
        return len(self._spool.waiting())

    def _report(self, _text: str) -> CollectorReport:
        settings = self._settings
        return CollectorReport(
            version=importlib.metadata.version("gwrms"),
            pid=os.getpid(),
            began_utc_s=self._began_s,
            spool=str(self._spool.folder),
            store=settings.store.url,
            upload=settings.recorder.upload,
            disk_free_bytes=self._disk_free(),
            robots=self._fleet.report(),
            recorder=self._recorder.state,
            uploader=self._uploader.look(),
            threads=self.watch.look(),
            is_paused=self._fleet.is_paused,
            prediction=None if self._prediction is None else self._prediction.state,
        )

    def _disk_free(self) -> int:
        folder = self._spool.folder
        try:
            return shutil.disk_usage(folder).free
        except OSError as error:
            raise SpoolUnusable(f"the spool {folder} cannot be read: {error.strerror}") from error


def whole(recorder: RecordingSettings) -> FollowSettings:
    """Return the settings to follow a robot completely: everything that the store has a table for."""
    return FollowSettings(
        client="gwrms collect",
        channels=recorder.channels,
        rate_hz=recorder.rate_hz,
        look_s=ONCE,
        resources=ResourceSnapshotParams(include=["disk", "network", "thermal", "kernel"]),
        resources_s=recorder.resources_s,
        journal_s=JOURNAL_S,
    )


def _tell_all(listeners: Sequence[TellPredictions | None], news: Sequence[PredictionNews]) -> None:
    for listener in listeners:
        if listener is not None:
            listener(news)


def connect(store: StoreSettings) -> Store:
    """Return the store that the server's file names."""
    return Store(store.url, store.shards, store.several_writers)
