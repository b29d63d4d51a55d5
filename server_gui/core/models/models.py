"""The models of the store, as the window works with them: looked at in a thread, trained in a process."""

import time
from collections.abc import Callable, Mapping, Set
from dataclasses import replace
from enum import Enum
from types import MappingProxyType
from typing import Final

from gateway.user_name import user_name
from server_gui.core.cloud.jobs import Job, Jobs, JobState, Work
from server_gui.core.cloud.store_reach import StoreReach
from server_gui.core.models import training
from server_gui.core.models.catalogue import Catalogue, Looking
from server_gui.core.models.changes import ModelChange, carry_out, promotion, way_back
from server_gui.core.models.lessons import Lessons, lessons
from server_gui.core.models.training import Trained, TrainingWish
from server_gui.core.threads.answers import Deliver, when_done
from server_gui.core.threads.background import Background

LOOK_S: Final = 15.0  # between looks, while somebody looks
AGAIN_S: Final = 5.0  # before a store that was away is tried again
Teach = Callable[[str, TrainingWish, Callable[[Trained], None]], Work]  # the work of a training, at a URL
NOT_BETTER: Final = (
    "It was judged, and is not better: {why}. The window promotes nothing that was judged so; "
    "gwrms models promote does, if you know better."
)


class Tone(Enum):
    """Tone of a message."""

    PLAIN = ""
    GOOD = "good"
    BAD = "bad"


class Models:
    """For the window's thread; `close` ends its own. `revision` rises with every look that came back."""

    def __init__(
        self,
        url: str,
        deliver: Deliver,
        robots: Callable[[], Set[str]],
        who: str = "",
        promoters: Mapping[str, str] = MappingProxyType({}),
        reach: StoreReach | None = None,
    ) -> None:
        self.url = url
        self.reach = reach or StoreReach()  # of the store
        self.knock: Callable[[], None] = lambda: None  # see at once whether it is reached
        self.found = Catalogue()  # by the newest look that read the store; its problem is of the newest one
        self.known_s: float | None = None  # when that look came back (UTC); None: the store was never read
        self.revision = 0
        self.looked_s: float | None = None  # when the newest look came back, on our monotonic clock
        self.change: ModelChange | None = None  # what waits to be confirmed
        self.said = ""  # what came of the newest wish, in words
        self.tone = Tone.PLAIN  # of that
        self.trained: dict[str, Trained] = {}  # what this window has trained, by model
        self.robots = robots
        self.jobs = Jobs(lambda job: deliver(lambda: self._over(job)), "training")
        self._who = who or user_name()
        self._deliver = deliver
        self._thread = Background("list of models")
        self._looking = Looking(url, promoters)
        self.lessons: Lessons | None = None  # of what was asked last; None while that is not known
        self._lessons_of: tuple[str, str] | None = None
        self._lessons_s: float | None = None  # when they were asked for, on our monotonic clock
        self._looks = False
        self._results: list[tuple[str, Tone]] = []  # of trainings, said once their models are listed
        self._lists = 0  # of them, those whose models the look under way must find
        self._ending = False

    def close(self, within_s: float) -> bool:
        """End a training, look no more; False where something hangs. Idempotent."""
        self._ending = True
        ended = [part.close(within_s) for part in (self.jobs, self._thread)]
        return all(ended)

    @property
    def is_reached(self) -> bool:
        """Whether what was found is what the store has."""
        return self.reach.problem is None and not self.found.problem

    def look(self, *, now: bool = False) -> None:
        """Look again where it is time, or at once."""
        wait_s = LOOK_S if self.is_reached else AGAIN_S
        due = self.looked_s is None or time.monotonic() - self.looked_s >= wait_s
        if self._looks or not (now or due):
            return
        self._looks, self._lists = True, len(self._results)
        robots = frozenset(self.robots())
        look = self._thread.do(lambda: self._looking.look(robots, lambda: self._ending))
        when_done(look, self._deliver, self._looked, self._look_failed)

    # --- training

    @property
    def is_training(self) -> bool:
        """Whether a training waits or is under way."""
        return any(not job.is_over for job in self.jobs.jobs)

    def look_for_lessons(self, task: str, robot: str) -> None:
        """Look what is labelled for a training, where it is time: for a form that is open."""
        of, now_s = (task, robot), time.monotonic()
        if of == self._lessons_of and self._lessons_s is not None and now_s - self._lessons_s < LOOK_S:
            return
        if of != self._lessons_of:
            self.lessons = None
        self._lessons_of, self._lessons_s = of, now_s

        def found(answer: Lessons) -> None:
            if of == self._lessons_of:  # else something else was asked meanwhile
                self.lessons = answer

        def failed(error: Exception) -> None:
            found(Lessons(problem=f"internal error, {type(error).__name__}"))

        when_done(self._thread.do(lambda: lessons(self.url, task, robot)), self._deliver, found, failed)

    def train(self, wish: TrainingWish, teach: Teach) -> Job:
        """Train in the background; it publishes a model, and promotes none."""

        def done(trained: Trained) -> None:
            self._deliver(lambda: self.trained.update({trained.model: trained}))

        return self.jobs.add(wish.title, teach(self.url, wish, done))

    # --- what serves

    def ask_promotion(self, model: str, robot: str) -> None:
        """Find out what it would change, for `change` to be confirmed."""
        judged = self.trained.get(model)
        if judged is not None and not judged.may_serve:
            self._say(NOT_BETTER.format(why=judged.reasons), Tone.BAD)
            return
        said = "" if judged is None else judged.said
        self._ask(lambda: replace(promotion(self.url, model, robot), judged=said))

    def ask_rollback(self, task: str, robot: str) -> None:
        """Find out what it would change, for `change` to be confirmed."""
        self._ask(lambda: way_back(self.url, task, robot))

    def confirm(self, why: str = "") -> None:
        """Do what `change` says, if nothing else has changed what serves since."""
        change, self.change = self.change, None
        if change is None:
            return
        done = self._thread.do(lambda: carry_out(self.url, change, self._who, why))
        when_done(done, self._deliver, lambda _: self._done(change), self._refused)

    def forget(self) -> None:
        """Change nothing."""
        self.change = None
        self._say("")

    # --- inside

    def _ask(self, plan: Callable[[], ModelChange]) -> None:
        self.change = None
        self._say("Looking what that changes …")
        when_done(self._thread.do(plan), self._deliver, self._planned, self._refused)

    def _planned(self, change: ModelChange) -> None:
        if change.changes_nothing:
            self._say(" ".join(change.sentences))
            return
        self.change = change
        self._say("")

    def _done(self, change: ModelChange) -> None:
        self._say(f"Done. {change.outcome}.", Tone.GOOD)
        self.look(now=True)

    def _refused(self, error: Exception) -> None:
        self._say(f"Refused: {error}", Tone.BAD)
        self.look(now=True)

    def _say(self, text: str, tone: Tone = Tone.PLAIN) -> None:
        self.said, self.tone = text, tone

    def _looked(self, found: Catalogue) -> None:
        self._looks, self.looked_s = False, time.monotonic()
        self.revision += 1
        if self.reach.problem is None and not found.problem:
            self.known_s = time.time()
        elif self.known_s is not None:  # what a store has that is away is what it had
            found = replace(self.found, problem=found.problem)
        self.found = found
        listed, self._results = self._results[: self._lists], self._results[self._lists :]
        for text, tone in listed:
            self._say(text, tone)
        if self._results:  # over since this look began
            self.look(now=True)

    def _look_failed(self, error: Exception) -> None:
        self._looked(Catalogue(problem=f"internal error, {type(error).__name__}"))

    def _over(self, job: Job) -> None:
        if job.state is JobState.FAILED:
            self._say(f"{job.name}: {job.said}", Tone.BAD)
        else:
            tone = Tone.PLAIN if job.said.lower().startswith(training.NOT_BETTER) else Tone.GOOD
            self._results.append((f"Trained{job.name.removeprefix('Train')}: {job.said}", tone))
        self.look(now=True)
