"""One commissioning as the window knows it: fed with what the command says, it says what can be done now.

The command is a process of its own, behind `Talker`: whatever becomes of it, the window goes on, and whatever
becomes of the window, the command ends. It belongs to one thread, the window's; only `stop` is for any.
"""

import signal
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Final, Protocol

from gateway.plain_text import one_line
from server_gui.core.commissioning import messages
from server_gui.core.commissioning.messages import (
    Message,
    ReadingMessage,
    StepMessage,
    StoppedMessage,
    WrittenMessage,
)
from server_gui.core.commissioning.request import CommissioningRequest
from server_gui.core.commissioning.stages import LOOKS, Stage, StageView

MOST_LINES: Final = 2000  # of what was said
MOST_NEWS: Final = 16  # and since the last answer
GUARD_S: Final = 0.4  # a click within it was meant for the question before
STOP_S: Final = 2.5  # for the command to have stopped the drives; then another one does it
KILL_S: Final = 2.5  # for one that was killed to be gone; then the other one begins all the same
STOPPER_S: Final = 30.0  # for that one to say what the drives confirm, also on another computer
OFF_S: Final = 1.0  # beyond it nobody knows whether a drive still has no power
OLD_S: Final = 2.0  # live values beyond it are not live
SILENT_S: Final = 60.0  # that long no step takes
MOVING_SILENT_S: Final = 2.0  # and while a joint is under power that is told again and again
# How the command ends by itself: not finished, wrong usage or not there, by a signal that it has taken.
OWN_ENDS: Final = {
    0: Stage.LEFT,
    1: Stage.LEFT,
    **dict.fromkeys((2, 126, 127), Stage.FAILED),
    **dict.fromkeys((128 + 1, 128 + 2, 128 + 15), Stage.LEFT),
}
SSH_FAILED: Final = 255  # it did not connect, or the connection is gone


@dataclass(frozen=True, slots=True)
class Exit:
    """End of a command: its status (None: it did not start), and its last words."""

    status: int | None
    last_words: str = ""


class Talker(Protocol):
    """A command that runs, and is talked to: all but `join` return at once, from any thread."""

    @property
    def ended(self) -> Exit | None:
        """Once it has, and every line of it was heard."""
        ...

    def heard(self) -> Sequence[str]:
        """Return lines that have come since the last time."""
        ...

    def send(self, line: str) -> None: ...

    def end(self) -> None: ...

    def kill(self) -> None: ...

    def join(self, within_s: float) -> bool:
        """Wait for its end; whether that has come."""
        ...


Talk = Callable[[Sequence[str], str], Talker]  # `gwrms` with these arguments, on this computer ("": here)


class LogLineKind(Enum):
    """Kind of a line of the log: its prefix."""

    SAID = "  "
    ASKED = "? "
    ANSWERED = "> "
    NOTED = "■ "


@dataclass(frozen=True, slots=True)
class Unconfirmed:
    """A STOP of a robot that was commissioned, and has not confirmed it since (UTC)."""

    name: str
    why: str
    since_s: float


class Commissioning:
    """`talk` starts a command; `look` takes what has come, some times a second."""

    def __init__(self, talk: Talk, clock: Callable[[], float] = time.monotonic, who: str = "") -> None:
        self.who = who  # sits at the window; "": it was not said
        self.wish: CommissioningRequest | None = None
        self._stage = Stage.NOT_STARTED
        self.since_s = time.time()  # UTC: of the stage
        self.unconfirmed: dict[str, Unconfirmed] = {}  # by place, whatever is commissioned after it
        self.question: Message | None = None
        self.steps: tuple[StepMessage, ...] = ()
        self.proposed: tuple[str, str] | None = None  # the file's name and text, before it is written
        self.written: WrittenMessage | None = None
        self.problem = ""  # in words, of whatever is wrong now
        self.drives_only = False  # a STOP does not reach what commands them
        self.off: frozenset[str] = frozenset()  # drives that had no power when STOP was asked for
        self.proof: StoppedMessage | None = None  # what the drives have said to the latest STOP
        self.log: deque[str] = deque(maxlen=MOST_LINES)
        self.logged = 0  # lines ever
        self.news: deque[str] = deque(maxlen=MOST_NEWS)  # said since the last answer
        self._talk = talk
        self._clock = clock
        self._talker: Talker | None = None
        self._stopper: Talker | None = None  # another command, that stops the drives where the first does not
        self._ending = False
        self._powered = False  # a joint was under power, and nobody has said since that it no longer is
        self._stop_s: float | None = None  # when STOP was asked for
        self._stopped: StoppedMessage | None = None
        self._error = ""
        self._live: tuple[ReadingMessage, ...] = ()
        self._live_s = 0.0
        self._asked_s = 0.0
        self._heard_s = 0.0

    # --- what is so

    @property
    def stage(self) -> Stage:
        """The present one."""
        return self._stage

    @stage.setter
    def stage(self, stage: Stage) -> None:
        if stage is not self._stage:
            self._stage, self.since_s = stage, time.time()
        if self.wish is not None and stage is Stage.NOT_CONFIRMED:
            self.unconfirmed[self.wish.place] = Unconfirmed(self.name, self.problem, self.since_s)
        elif self.wish is not None and stage is Stage.STOPPED:
            self.unconfirmed.pop(self.wish.place, None)

    @property
    def look_of(self) -> StageView:
        return LOOKS[self.stage]

    @property
    def runs(self) -> bool:
        return self.look_of.runs

    @property
    def name(self) -> str:
        """The robot's name, which its file has; "" before one was named."""
        return "" if self.wish is None else Path(self.wish.file).stem

    @property
    def progress(self) -> str:
        """How many steps are done, or passed; "" before it has said its steps."""
        done = sum(one.state in ("done", "passed") for one in self.steps)
        return f"{done} of {len(self.steps)} steps done" if self.steps else ""

    @property
    def can_start(self) -> bool:
        """Once what ran before has ended."""
        return not self.runs and self._talker is None and self._stopper is None

    @property
    def can_answer(self) -> bool:
        """Not at once: a second click is not meant for the next question."""
        return self.look_of.answers and self._clock() - self._asked_s >= GUARD_S

    @property
    def can_stop(self) -> bool:
        """As soon as there is something to ask: also what a command that has died has left."""
        return self.wish is not None

    @property
    def live(self) -> tuple[ReadingMessage, ...]:
        """The devices' present values; empty if they are old, or missing."""
        return self._live if self._clock() - self._live_s < OLD_S else ()

    @property
    def is_silent(self) -> bool:
        """Whether it says nothing for longer than anything takes."""
        if self.stage is Stage.MOVING:
            return self.working_s > MOVING_SILENT_S
        return self.stage in (Stage.WORKING, Stage.STARTING) and self.working_s > SILENT_S

    @property
    def working_s(self) -> float:
        """Since when nothing was heard."""
        return self._clock() - self._heard_s

    # --- what is done

    def start(self, wish: CommissioningRequest) -> None:
        """Begin, or go on; raises `ValueError` where something is missing. Nothing where it runs."""
        if wish.problem:
            raise ValueError(wish.problem)
        if not self.can_start:
            return
        self.wish = wish
        self.question, self.steps, self.proposed, self.written = None, (), None, None
        self.problem, self._error, self._stopped, self._stop_s, self._ending = "", "", None, None, False
        self.proof, self.drives_only, self.off = None, False, frozenset()
        self._live, self._powered = (), False
        self.news.clear()
        self._note(LogLineKind.NOTED, wish.typed)
        self._heard_s = self._clock()
        self.stage = Stage.STARTING
        self._talker = self._talk(wish.arguments("--json"), wish.computer)

    def answer(self, text: str) -> bool:
        """Answer the question; whether that was sent: nothing answers twice, or too early."""
        question, talker = self.question, self._talker
        if question is None or talker is None or not self.can_answer:
            return False
        line = one_line(text)
        self._note(LogLineKind.ANSWERED, line or (question.default or ("done" if question.press else "")))
        self.question, self._live, self.problem = None, (), ""
        self.news.clear()
        self._heard_s = self._clock()
        self.stage = Stage.WORKING
        talker.send(messages.answer(line, question.number))
        return True

    def stop(self) -> None:
        """STOP: the command ends what it does, and quick-stops every drive that is known. From any thread."""
        if self._stop_s is None or not self.runs:
            self._stop_s, self._stopped = self._clock(), None  # what was confirmed before is of before
            self.proof = None
            is_new = self._clock() - self._live_s < OFF_S
            self.off = messages.without_power(self._live) if is_new else frozenset()
        talker = self._talker
        if talker is not None:
            talker.send(messages.STOP)

    def interrupt(self) -> None:
        """End the command; what was found is kept."""
        if self._talker is not None and self.runs:
            self._ending = True
            self._talker.end()

    def close(self, within_s: float) -> bool:
        """End all of it, and wait; whether it has ended. A STOP that is owed goes on to its end."""
        until = self._clock() + within_s
        talker, ended = self._talker, True
        if talker is not None:
            talker.end()
            ended = talker.join(within_s)
        owed = self._powered or (self._stop_s is not None and self._stopped is None)
        if owed and self._stopper is None and self.wish is not None:
            self._stopper = self._talk(self.wish.stopping, self.wish.computer)
        return ended and (self._stopper is None or self._stopper.join(max(0.0, until - self._clock())))

    def look(self) -> None:
        """Take what has come, and see how it is."""
        for talker in (self._talker, self._stopper):
            if talker is not None:
                for text in talker.heard():
                    self._take(messages.understood(text))
        self._see_to_stop()
        self._see_to_end()
        if self.stage is not Stage.STOPPING and self._stop_s is None and self._ending and self.runs:
            self.stage = Stage.ENDING

    # --- inside

    def _take(self, line: Message) -> None:
        self._heard_s = self._clock()
        if line.say is not None:
            self._said(line)
        elif line.ask is not None:
            self._asked(line)
        elif line.live is not None:
            self._told(line)
        elif isinstance(line.moving, str):
            self._moves(line.moving)
        elif line.moving is None:
            self._rests()
        elif line.steps is not None:
            self.steps = line.steps
        elif line.written is not None:
            self.written = line.written
        elif line.stopped is not None:
            self._stopped = self.proof = line.stopped
            self._stop_s = self._clock() if self._stop_s is None else self._stop_s  # by itself, too
            self._powered = self._powered and not line.stopped.confirmed
            self._note(LogLineKind.NOTED, line.stopped.words)
        elif line.error is not None:
            self._error = line.error.message
        if self.stage is Stage.STARTING:
            self.stage = Stage.WORKING

    def _moves(self, words: str) -> None:
        if self.stage is not Stage.MOVING:
            self._note(LogLineKind.NOTED, words)
        self._powered = True
        if self.runs:
            self.stage, self.problem, self.question, self._live = Stage.MOVING, words, None, ()

    def _rests(self) -> None:
        self._powered = False
        if self.stage is Stage.MOVING:
            self.stage, self.problem = Stage.WORKING, ""

    def _said(self, line: Message) -> None:
        self._note(LogLineKind.SAID, line.say or "")
        self.drives_only = self.drives_only or (line.say or "").startswith(messages.DRIVES_ONLY)
        if line.file:
            self.proposed = (line.file, line.say or "")
        else:
            self.news.extend((line.say or "").splitlines())

    def _asked(self, line: Message) -> None:
        if self.question == line or not self.runs:  # told twice
            return
        self._note(LogLineKind.ASKED, line.question)
        self.question, self._live, self.problem = line, (), ""
        self._asked_s = self._clock()
        self.stage = Stage.HAND if line.press else Stage.ASKING

    def _told(self, line: Message) -> None:
        """Live values of the question that waits; those of another come late."""
        if self.question is None or line.number != self.question.number:
            return
        self.problem = line.problem
        self._live, self._live_s = line.live or (), self._clock()
        self.stage = Stage.BUS_GONE if line.problem else Stage.HAND

    def _see_to_stop(self) -> None:
        """Let another command stop the drives if this one does not in time, or is gone."""
        if self._stop_s is None or self.wish is None:
            return
        if self._stopped is not None:
            self.problem = "" if self._stopped.confirmed else self._stopped.why
            self._end_stop(Stage.STOPPED if self._stopped.confirmed else Stage.NOT_CONFIRMED)
            return
        self.stage, self.question, self._live = Stage.STOPPING, None, ()
        talker, stopper, since_s = self._talker, self._stopper, self._clock() - self._stop_s
        if stopper is not None:
            if stopper.ended is None and since_s > STOPPER_S:
                stopper.kill()
            if stopper.ended is not None:
                self.problem = stopper.ended.last_words or "the command that stops the drives has ended"
                self._end_stop(Stage.NOT_CONFIRMED)
            return
        if talker is not None and talker.ended is None and since_s > STOP_S:
            talker.kill()
        if talker is None or talker.ended is not None or since_s > STOP_S + KILL_S:
            self._note(LogLineKind.NOTED, "STOP: the command did not do it, another one asks the drives")
            self._stopper = self._talk(self.wish.stopping, self.wish.computer)

    def _end_stop(self, stage: Stage) -> None:
        self.stage, self.question = stage, None
        if all(one is None or one.ended is not None for one in (self._talker, self._stopper)):
            self._talker = self._stopper = None
            self._stop_s = self._stopped = None

    def _see_to_end(self) -> None:
        if self._talker is None or self._stop_s is not None or (ended := self._talker.ended) is None:
            return
        self._talker, self.question, self._live = None, None, ()
        self.stage, self.problem = self._end_of(ended)
        if self.problem:
            self._note(LogLineKind.NOTED, self.problem)
        if self._powered:  # what it has put under power nobody else would stop
            self.stop()
            self._see_to_stop()

    def _end_of(self, ended: Exit) -> tuple[Stage, str]:
        if self.written is not None:
            return (Stage.WRITTEN if self.written.usable else Stage.UNUSABLE), ""
        words = self._error or ended.last_words
        if ended.status is None or self._error:
            return Stage.FAILED, words
        if self._ending:
            return Stage.LEFT, ""
        if ended.status in OWN_ENDS:
            return OWN_ENDS[ended.status], words
        if ended.status == SSH_FAILED and self.wish is not None and self.wish.computer:
            return Stage.DIED if self.steps else Stage.FAILED, words
        return Stage.DIED, words or _status_text(ended.status)

    def _note(self, kind: LogLineKind, text: str) -> None:
        for place, line in enumerate(text.splitlines() or [""]):
            self.log.append((kind.value if place == 0 else "  ") + line)
            self.logged += 1


def _status_text(status: int) -> str:
    return (
        f"It was killed by {signal.Signals(-status).name}." if status < 0 else f"Its exit status is {status}."
    )
