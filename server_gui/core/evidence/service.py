"""A thread that follows every robot's edits, and keeps what came of them; nobody ever waits for it."""

import collections
import functools
import logging
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final, Self

from msgspec.structs import replace

from ml.serving.predictor import Prediction
from server_gui.core.evidence.file import EditEvidence, EvidenceFile
from server_gui.core.evidence.robot_evidence import Recorded, RobotEvidence
from server_gui.core.follow.events import Event, without_processes
from server_gui.core.prediction.inbox import Inbox
from server_gui.core.prediction.news import Predicted, PredictionNews
from server_gui.core.threads.supervision import BEAT_S, Worker

log = logging.getLogger(__name__)

LOOK_S: Final = 1.0  # between looks at edits whose evidence still grows
STILL_S: Final = 2.0
ACTIVITY: Final = "activity"  # the task
MOST_SAID: Final = 4096  # what may wait of what models say

Tell = Callable[[str, EditEvidence], None]  # (robot, what is known now), in the service's thread


class EvidenceService:
    """Follows edits from entering to leaving; use it as a context manager, which joins its thread.

    `take` gets everything that the robots' feeds tell, `predicted` what models say of them. What is final is
    kept in `folder`, and what is not when this ends: of robots that were recorded when the edit was made, as
    `session` tells. It belongs to that recording: by the time it is final, somebody else may wear the robot.
    `tell` is told of each change, and first of what was kept of a robot before.
    """

    def __init__(self, folder: Path, session: Callable[[str], str], tell: Tell | None = None) -> None:
        self._folder = folder
        self._session = session
        self._tell = tell
        self._inbox = Inbox[Event | Recorded]()
        self._robots: dict[str, RobotEvidence] = {}
        self._said: collections.deque[tuple[str, Prediction]] = collections.deque(maxlen=MOST_SAID)
        self._recorded: dict[str, str] = {}  # by robot: what its recording is called, as was told last
        self._sizes: dict[str, int] = {}  # of the file of each when it was read
        self._kept: dict[str, set[str]] = {}  # edits in those files that were told
        self._looked_s = 0.0
        self.worker = Worker("evidence", self._run, STILL_S)

    def __enter__(self) -> Self:
        self.worker.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._inbox.close()
        self.worker.join()

    def take(self, robot: str, event: Event) -> None:
        """Take an event of a robot's feed; from any thread, returns at once."""
        session = self._session(robot)
        if self._recorded.get(robot) != session:
            self._recorded[robot] = session
            self._inbox.put(robot, Recorded(session))
        self._inbox.put(robot, without_processes(event))

    def predicted(self, news: Iterable[PredictionNews]) -> None:
        """Take models' predictions; from any thread, returns at once."""
        for one in news:
            if isinstance(one, Predicted) and one.prediction.task == ACTIVITY:
                self._said.append((one.robot, one.prediction))

    # --- its thread

    def _run(self) -> None:
        while (taken := self._inbox.take(BEAT_S)) is not None:
            self.worker.beat()
            for robot, said in [self._said.popleft() for _ in range(len(self._said))]:
                if robot in self._robots:
                    self._robots[robot].label(said.stamp_ns, said.label)
            for robot, events in taken.items():
                self._guarded(robot, functools.partial(_taken, events))
            now_s = time.monotonic()
            if now_s - self._looked_s >= LOOK_S:
                self._looked_s = now_s
                for robot in list(self._robots):
                    self._guarded(robot, RobotEvidence.look)
                    self._tell_news(robot)
        for robot in list(self._robots):
            self._guarded(robot, RobotEvidence.end)

    def _guarded(self, robot: str, work: Callable[[RobotEvidence], Iterable[EditEvidence]]) -> None:
        """Isolate errors of one robot from the others."""
        self.worker.beat()
        known = self._robots.get(robot)
        if known is None:
            known = self._robots[robot] = RobotEvidence(robot)
            self._tell_kept(robot)
        try:
            for told in work(known):
                self._told(robot, told)
        except Exception:
            log.exception("%s sent what no evidence can be found in; begun anew", robot)
            self._robots[robot] = known.anew()

    def _tell_news(self, robot: str) -> None:
        """Report evidence kept by commands such as `gwrms ab`."""
        if self._size(robot) != self._sizes.get(robot):
            self._tell_kept(robot)

    def _size(self, robot: str) -> int:
        try:
            return EvidenceFile(self._folder, robot).path.stat().st_size
        except OSError:
            return 0

    def _tell_kept(self, robot: str) -> None:
        if self._tell is None:
            return
        self._sizes[robot] = self._size(robot)
        try:
            for told in EvidenceFile(self._folder, robot).read().values():
                if told.edit.id in self._kept.setdefault(robot, set()):
                    continue
                self._kept[robot].add(told.edit.id)
                if told.edit.robot == robot:  # names that differ in signs share a file
                    self._tell(robot, told)
        except OSError as error:
            log.error("the edits of %s that were kept cannot be read: %s", robot, error)

    def _told(self, robot: str, told: EditEvidence) -> None:
        session = self._robots[robot].session_of(told.edit)
        if told.is_final and session:
            try:
                EvidenceFile(self._folder, robot).add(replace(told, session=session))
            except OSError as error:
                log.error("the evidence of edit %s of %s is not kept: %s", told.edit.id, robot, error)
            self._kept.setdefault(robot, set()).add(told.edit.id)
        if self._tell is not None:
            self._tell(robot, told)


def _taken(events: Iterable[Event | Recorded], known: RobotEvidence) -> list[EditEvidence]:
    return [told for event in events for told in known.take(event)]
