"""How robots' facts come to the window, and who records and predicts on the way.

The window's own collector does, which keeps what comes before it is shown. While another program records into
the same spool, the window follows robots without; it takes over when that program has ended.
"""

import concurrent.futures
import functools
import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Self

from msgspec.structs import replace

from gateway.client import Address
from server_gui.core.desk.recording import By, Recording
from server_gui.core.evidence.file import EditEvidence, EvidenceFile, folder_beside
from server_gui.core.evidence.service import EvidenceService
from server_gui.core.evidence.service import Tell as TellEvidence
from server_gui.core.fleet.collector import Collector, whole
from server_gui.core.fleet.fleet import Subscriber
from server_gui.core.fleet.live_prediction import TellPredictions
from server_gui.core.fleet.remote_collector import RemoteCollector
from server_gui.core.fleet.stop_links import StopRobot
from server_gui.core.follow.events import Event, without_processes
from server_gui.core.follow.feed import Feed, FollowSettings
from server_gui.core.follow.network import Network
from server_gui.core.follow.news import News
from server_gui.core.prediction.adaptation import Happening
from server_gui.core.prediction.news import PredictionNews
from server_gui.core.prediction.service import PredictionService
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.records import NOBODY, Worn
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings
from server_gui.core.threads.answers import Deliver
from server_gui.core.threads.supervision import ThreadWatch

log = logging.getLogger(__name__)

RESOURCES_S: Final = 2.0  # between looks at a robot's computer, at most
GIVE_WAY_S: Final = 4.0  # before who has gone is replaced: a service that begins anew goes first
AGAIN_S: Final = 1.0  # between attempts


@dataclass(frozen=True, slots=True)
class Record:
    """That the window records what it shows; who does so, and why."""

    operator: str = ""
    notes: str = ""
    worn: Worn = NOBODY


class Feeds:
    """For the window's thread; use it as a context manager, which ends every thread.

    Without `record` it only shows. `network` is for other links, too. `stop` stops a robot where a rule on
    what is predicted wants it.
    """

    def __init__(
        self,
        settings: ServerSettings,
        following: FollowSettings,
        record: Record | None,
        show: Subscriber,
        tell_predictions: TellPredictions,
        stop: StopRobot,
        tell_evidence: TellEvidence,
    ) -> None:
        self._settings = settings
        self._following = following
        self._record = record
        self._show = show
        self._tell_predictions = tell_predictions
        self._stop = stop
        self._tell_evidence = tell_evidence
        self._robots: dict[str, Address] = {}
        self._tasks: dict[str, concurrent.futures.Future[None]] = {}  # what follows each
        self._tried_s = 0.0
        self._ending = concurrent.futures.ThreadPoolExecutor(1, "ending")
        self._collector, self._why = self._collect()
        self._own: Network | None = None
        self._elsewhere: RemoteCollector | None = None
        self._predicting: PredictionService | None = None
        self._judging: EvidenceService | None = None
        if self._collector is not None:
            self.network = self._collector.network
        else:
            self.network = self._own = Network()
            self._elsewhere = None if record is None else RemoteCollector(settings.recorder.spool)
            self._predicting = (
                PredictionService(settings, self._predicted) if settings.prediction.enabled else None
            )
            folder = folder_beside(settings.recorder.spool)
            self._judging = EvidenceService(folder, lambda _robot: "", tell_evidence)
        predicting = () if self._predicting is None else self._predicting.workers
        judging = () if self._judging is None else (self._judging.worker,)
        self.others = ThreadWatch(())  # threads of the window itself
        self._watch = ThreadWatch((self.network.worker, *predicting, *judging))  # where no collector has one

    def __enter__(self) -> Self:
        for part in (self._collector, self._own, self._predicting, self._judging):
            if part is not None:
                part.__enter__()
        return self

    def __exit__(self, *exc: object) -> None:
        for part in (self._collector, self._own):
            if part is not None:
                part.__exit__(*exc)
        self._end_showing_only()
        self._ending.shutdown()

    def keep(self, robot: str, told: EditEvidence, session: str) -> None:
        """Keep what came of an experiment beside the evidence for edits; nobody waits for the disk."""

        def add() -> None:
            folder = folder_beside(self._settings.recorder.spool)
            try:
                EvidenceFile(folder, robot).add(replace(told, session=session))
            except OSError as error:
                log.error("what came of %s of %s is not kept: %s", told.edit.names, robot, error)

        self._ending.submit(add)

    def adapt(self, robot: str, number: int, what: Happening) -> None:
        """Say what becomes of what was learned from a robot's wearer."""
        if self._collector is not None:
            self._collector.adapt(robot, number, what)

    @property
    def hangs(self) -> bool:
        """Whether something still runs after all was ended, which only the end of the process ends."""
        return self._collector is not None and self._collector.hangs

    @property
    def ends(self) -> str:
        """What it waits for while it is left."""
        return "" if self._collector is None else self._collector.ends

    def hurry(self) -> None:
        """Wait for nothing but what goes to the disk, from any thread."""
        if self._collector is not None:
            self._collector.hurry()

    @property
    def by_source(self) -> bool:
        """Whether single sources' samples come, which views cannot draw."""
        return self._collector is not None and self._settings.recorder.rate_hz == 0

    def recording(self, deliver: Deliver, news: News) -> Recording:
        """Return what there is to say of who records; `look` keeps it right."""
        keeper = self._collector or self._elsewhere
        by = {Collector: By.WINDOW, RemoteCollector: By.OTHER}.get(type(keeper), By.NOBODY)
        return Recording(by, keeper, deliver, news, self._why, self._collector)

    def follow(self, name: str, address: Address) -> None:
        """Follow another robot from now on."""
        self._robots[name] = address
        if self._collector is not None:
            self._tasks[name] = self._collector.follow(name, address)
        else:
            feed = Feed(address, [functools.partial(self._shown, name)], self._following)
            self._tasks[name] = self.network.run(feed.run())

    def leave(self, name: str) -> None:
        """Follow a robot no more; its recording ends."""
        del self._robots[name]
        task = self._tasks.pop(name)
        if self._collector is not None:
            self._collector.leave(name)
        else:
            task.cancel()

    def look(self, recording: Recording) -> None:
        """Now and then: see how it goes, and record where nobody does any more."""
        for task in self._tasks.values():
            if task.done() and not task.cancelled():
                task.result()  # it ends only by a mistake of ours, which must not stay unseen
        if self._collector is not None:
            self._collector.wait(0.0)
        elif self._record is not None and recording.is_alone(GIVE_WAY_S):
            self._take_over(recording)
        watch = self._watch if self._collector is None else self._collector.watch
        recording.see((*watch.look(), *self.others.look()))
        recording.look()

    # --- inside

    def _collect(self) -> tuple[Collector | None, str]:
        """Return a collector, or why there can be none."""
        if self._record is None:
            return None, "the window was started to show only"
        following = shown_and_recorded(self._following, self._settings.recorder)
        nobody = replace(self._settings, robots={})  # each is told when the window follows it
        operator, notes = self._record.operator, self._record.notes
        try:
            return Collector(
                nobody,
                operator,
                notes,
                following,
                [self._kept],
                self._tell_predictions,
                self._stop,
                self._record.worn,
                self._tell_evidence,
            ), ""
        except SpoolUnusable as error:
            return None, str(error)

    def _take_over(self, recording: Recording) -> None:
        """Record from now on, if the spool can be had: it is given to one at a time."""
        now_s = time.monotonic()
        if now_s - self._tried_s < AGAIN_S:
            return
        self._tried_s = now_s
        collector, recording.why = self._collect()
        if collector is None:
            return
        collector.__enter__()
        self._collector = collector  # what the feeds of before still tell is dropped from now on
        for task in self._tasks.values():
            task.cancel()
        self._tasks = {name: collector.follow(name, address) for name, address in self._robots.items()}
        self._end_showing_only()
        recording.taken_over(collector, collector)

    def _end_showing_only(self) -> None:
        """In a thread: it may take a while."""
        predicting, judging, elsewhere = self._predicting, self._judging, self._elsewhere
        self._predicting = self._judging = self._elsewhere = None
        if elsewhere is not None:
            self._ending.submit(elsewhere.close)
        if predicting is not None:
            self._ending.submit(predicting.__exit__)
        if judging is not None:
            self._ending.submit(judging.__exit__)

    def _predicted(self, news: Sequence[PredictionNews]) -> None:
        """Ignore it: it is not recorded."""
        judging = self._judging
        if judging is not None:
            judging.predicted(news)
        self._tell_predictions(news)

    def _shown(self, robot: str, event: Event) -> None:
        """Ignore it: it is not recorded."""
        predicting = self._predicting
        if self._collector is not None:
            return
        if predicting is not None:
            predicting.take(robot, event)
        judging = self._judging
        if judging is not None:
            judging.take(robot, event)
        self._show(robot, without_processes(event))

    def _kept(self, robot: str, event: Event) -> None:
        """Show the kept values; the table of processes has a look of its own."""
        self._show(robot, without_processes(event))


def shown_and_recorded(shown: FollowSettings, recorder: RecordingSettings) -> FollowSettings:
    """Return what is asked of a robot that the window shows and records: by one link, once."""
    return replace(
        whole(recorder),
        client=shown.client,
        look_s=shown.look_s,
        resources_s=min(recorder.resources_s, RESOURCES_S),
        journal_s=shown.journal_s,
        buses_s=shown.buses_s,
    )
