"""Progress of a STOP: sent, then confirmed by every drive, or NOT CONFIRMED. Silence is never success."""

import time
from collections.abc import Collection, Iterable, Mapping, Sequence, Set
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

from gateway.amounts import counted
from gateway.client import ClockOffset
from gateway.wire.stop import Stopped

ENABLED = "operation enabled"
HELD_BY = frozenset({"stop", "stop still held"})  # entries of the journal
AGAIN = "stopped again"  # while one is held: by somebody, or a drive by the gateway
CLOCKS_NS = 50_000_000  # that ours and a robot's are compared to
CALENDAR_S = 1.0  # by which calendars that were compared over a link may differ


LEAST_MS = 1.0  # nothing is said to have stopped in 0 ms
LOOKS = 2  # at the journal: what comes later was written since the STOP


def is_off(word: str | None) -> bool:
    """Return whether a drive's state is known, and is not enabled; a number is of a state without a word."""
    return word is not None and word != ENABLED and not word.isdecimal()


class StopState(Enum):
    """State of the latest STOP."""

    IDLE = "no stop was sent"
    SENT = "sent"
    CONFIRMED = "confirmed"
    NOT_CONFIRMED = "NOT CONFIRMED"


class Sent:
    """A STOP on its way, timed where it is sent and where its answer comes: however late that is noted.

    `off` drives were seen not to be enabled when it was sent.
    """

    def __init__(self, at_ns: int, future: Future[Stopped], off: Collection[str] = ()) -> None:
        self.at_ns = at_ns
        self.off = off
        self.answered_ns: int | None = None
        self.future = future
        future.add_done_callback(self._done)

    def _done(self, _future: Future[Stopped]) -> None:
        self.answered_ns = time.monotonic_ns()


@dataclass(frozen=True, slots=True)
class Proof:
    """A drive's first state that is not enabled, and how long after the STOP it came; 0: it was so before.

    The time is what a row has shown, or the drive's own confirmation, whichever was first.
    """

    after_ms: float
    state: str

    @property
    def was_so(self) -> bool:
        """Whether the STOP has changed nothing of it."""
        return self.after_ms <= 0

    @property
    def when(self) -> str:
        """After the STOP."""
        return "already off" if self.was_so else f"{max(self.after_ms, LEAST_MS):.0f} ms"

    @property
    def text(self) -> str:
        """`switch on disabled 34 ms after the STOP`."""
        return f"{self.state} {'before' if self.was_so else f'{self.when} after'} the STOP"


@dataclass(slots=True)
class StopProgress:
    """One robot's latest STOP; a newer one counts, whatever an older one is answered with.

    A held stop may be somebody else's: the robot's journal tells of it.
    """

    state: StopState = StopState.IDLE
    text: str = ""
    why: str = ""  # it is not confirmed
    held: bool = False
    is_outdated: bool = False  # the robot's file cannot be used: it can confirm none
    reason: str = ""  # of the one that is held
    problem: str = ""  # why that will not outlive the robot's gateway
    was_ended: bool = False  # by a reset, since when nothing was enabled
    was_fault: bool = False  # that reset had no stop to end: it has cleared faults
    at_ns: int | None = None
    since_s: float | None = None  # UTC: of this state, as far as is known
    answered_ms: float | None = None
    calendar_ns: int = 0  # the robot's minus ours
    number: int = 0
    drives: int = 0  # that have confirmed it
    silent: tuple[str, ...] = ()  # controllers that have not confirmed it, where every drive has
    proofs: dict[str, Proof] = field(default_factory=dict)  # drive → what its state channel has shown
    _sent_s: float | None = None  # UTC: of the latest STOP
    _stood_s: float | None = None  # UTC: since when one is held that all have confirmed, or another
    _before_s: float | None = None  # the same, as the latest STOP was sent
    _heard_ns: int = 0  # when one was first known to be held by the robot's word, not by our STOP's answer
    _off: set[str] = field(default_factory=set)  # drives that were not enabled when it was sent
    _confirmed: Set[str] = frozenset()  # drives that have confirmed it
    _clock: ClockOffset | None = None  # of the robot when it was sent
    _boot_id: str | None = None  # likewise
    _reads: int = 0  # of the journal, since it was sent
    _told_s: float | None = None  # UTC: when the robot said itself that one of others is held
    _entry: int = 0  # of the journal: the newest that was read
    _is_written: bool = True  # whether the latest STOP was read in the journal: resets before are older

    @property
    def stage(self) -> tuple[StopState, bool]:
        """State of the latest STOP, and whether one is held."""
        return self.state, self.held

    @property
    def is_let_go(self) -> bool:
        """Whether it was confirmed, and by the robot's word none is held: its journal tells more."""
        return self.state is StopState.CONFIRMED and not self.held

    @property
    def is_unproven(self) -> bool:
        """Whether drives were told to stop and have not shown it: then "enabled" is no good state."""
        return self.state is StopState.NOT_CONFIRMED

    def sent(
        self,
        off: Collection[str] = (),
        at_ns: int | None = None,
        clock: ClockOffset | None = None,
        boot_id: str | None = None,
    ) -> int:
        """Note that a STOP has gone out, and return its number.

        `off` drives are seen not to be enabled; the robot's `clock` and boot are those of now. One that
        repeats another that nobody has answered yet is timed from that.
        """
        self.number += 1
        if self.state is StopState.SENT:
            self._off &= set(off)
        else:
            now_ns = time.monotonic_ns()
            self.at_ns = now_ns if at_ns is None else at_ns
            self._sent_s = time.time() - (now_ns - self.at_ns) / 1e9
            self._before_s = self._stood_s
            if not self.held or self.since_s is None:
                self.since_s = self._sent_s
            self.proofs, self._off, self._clock, self._boot_id, self._reads = {}, set(off), clock, boot_id, 0
        self.state, self.text, self.why, self.answered_ms = StopState.SENT, "STOP sent …", "", None
        self.silent, self._confirmed, self.was_ended, self._is_written = (), frozenset(), False, False
        self.is_outdated, self.problem = False, ""
        return self.number

    def answered(self, number: int, stopped: Stopped, at_ns: int | None = None) -> None:
        """Take the drives' answers, and their local time (default: now)."""
        if number != self.number:
            return
        self.held, self.problem = stopped.held, stopped.problem or ""
        if self.at_ns is not None:
            after_ns = (time.monotonic_ns() if at_ns is None else at_ns) - self.at_ns
            self.answered_ms = max(LEAST_MS, after_ns / 1e6)
        self._confirmed = {name for name, said in stopped.drives.items() if said == "confirmed"}
        self.proofs = {drive: self._earliest(drive, proof) for drive, proof in self.proofs.items()}
        outcomes = stopped.drives | {f"controller {name}": said for name, said in stopped.controllers.items()}
        missing = [f"{_listed([name])} {said}" for name, said in outcomes.items() if said != "confirmed"]
        self.is_outdated = stopped.outdated is not None
        if stopped.drives and len(self._confirmed) == len(stopped.drives) and not self.is_outdated:
            self.silent = tuple(name for name, said in stopped.controllers.items() if said != "confirmed")
        if stopped.outdated is not None:
            missing.append(stopped.outdated)
        if missing or not stopped.drives:
            self._not_confirmed(", ".join(missing) or "no drive answered")
        else:
            self.state, self.drives = StopState.CONFIRMED, len(stopped.drives)
            self._stand()
            self.text = self.timed(f"STOP confirmed by {self.every_drive}")

    def _stand(self) -> None:
        """Note since when it has stood: since this STOP, or one before that had stopped all of it."""
        was_so = self._before_s is not None and not self._confirmed - self._off
        self.since_s = self._stood_s = self._before_s if was_so else self._sent_s

    def failed(self, number: int, reason: str) -> None:
        """Note that nobody answered: consider the robot not stopped."""
        if number == self.number:
            self.silent, self._confirmed = (), frozenset()
            self._not_confirmed(reason)

    def was_reset(self, held: bool, at_s: float | None = None) -> None:
        """Take the result of a reset, and its UTC (default: now)."""
        was_held, self.held = self.held or self.state is not StopState.IDLE, held
        if not held:
            self.was_fault = not was_held and (self.was_fault or not self.was_ended)
            self.state, self.text, self.why, self.reason = StopState.IDLE, "", "", ""
            self.silent, self._confirmed = (), frozenset()  # they say nothing of the next one
            self.is_outdated, self.problem = False, ""
            self.was_ended, self.since_s = True, time.time() if at_s is None else at_s
            self._stood_s = None

    def goes_on(self) -> None:
        """Note that drives are enabled again after a reset: what that stop has shown is history."""
        if self.state is StopState.IDLE and not self.held:
            self.was_ended, self.proofs = False, {}

    # --- what the robot shows meanwhile

    def described(self, held: bool, reason: str | None, problem: str | None = None) -> None:
        """Take the robot's description on every new link: a stop may have ended while there was none.

        One that was confirmed here, and that nobody has reset by the robot's journal, is not ended: the robot
        holds it no more, and it may have lost it with its gateway or its computer.
        """
        self._hears(held)
        self._stood_s = self._stood_s if held else None
        if held and not self.held and self.state is StopState.IDLE:
            self.proofs, self.was_ended = {}, False
            self.since_s = None  # the journal, or our own STOP, tells since when
        self.held, self.reason = held, (reason or "") if held else ""
        self.problem = (problem or "") if held else ""
        self._told_s = time.time() if held and self.state is StopState.IDLE else None

    def read(self, entries: Iterable[Mapping[str, Any]], boot_id: str | None = None) -> None:
        """Take the newest entries of the robot's journal, oldest first: others stop and reset it too.

        They may be older than our STOP, by the robot's clock: what they hold and reset is not that one.
        `boot_id` is that of now.
        """
        told = [(number, entry) for entry in entries if isinstance(number := entry.get("n"), int)]
        if told and told[-1][0] < self._entry:
            self._entry = 0  # another journal
        is_open = self.state is StopState.NOT_CONFIRMED and not self.held
        was_ended, is_history, is_older = self.was_ended, self._entry == 0, False
        is_lost, is_told = False, is_history and self.held and self._told_s is not None
        reason, problem = self.reason, self.problem
        for number, entry in told:
            if number <= self._entry:
                continue
            self._entry = number
            if entry.get("what") in HELD_BY:
                is_lost = False
            elif _is_reset(entry):
                is_lost = is_history and self._is_before_its_word(entry)
            if self._is_after(entry, boot_id):
                self._read(entry, is_open=is_open)
            elif entry.get("what") in HELD_BY and not self.held:  # held still, as far as is read
                self._hears(True)
                self.held, self.reason, is_older = True, _said(entry), True
            elif is_older and _is_reset(entry):
                self.held, self.reason, is_older = False, "", False
        if is_lost and not self.held:  # the stop that is held was in no journal
            self.held, self.reason, self.since_s, self._stood_s = True, reason, None, None
        if is_told and self.held:
            self.problem = problem  # as the robot has said of it: what was before says nothing of that
        self._reads += 1
        if is_history and not was_ended:
            self.was_ended = False  # nobody knows what was enabled since

    def _is_before_its_word(self, entry: Mapping[str, Any]) -> bool:
        """Return whether a reset is older than the robot's own word: a stop since may be in no journal."""
        if self._told_s is None:
            return False
        return "utc_ns" not in entry or self._utc_s(entry) < self._told_s - CALENDAR_S

    def _is_after(self, entry: Mapping[str, Any], boot_id: str | None) -> bool:
        """Return whether an entry is no older than our STOP, whose own was not read yet.

        Where nobody can tell, it is for a STOP that was confirmed, and is not for one that was not: neither
        looks better for it. What comes with the third look has been written since.
        """
        if self.state is StopState.IDLE or self._is_written or self._reads >= LOOKS:
            return True
        of = entry.get("boot_id")
        if None not in (of, self._boot_id) and of != self._boot_id:
            return of == boot_id
        later_ns = self._later_ns(entry)
        if later_ns is None:
            return self.state is not StopState.NOT_CONFIRMED
        return later_ns >= 0

    def _later_ns(self, entry: Mapping[str, Any]) -> int | None:
        """Return how much later than our STOP it was written at most; None where the clocks do not say."""
        written_ns, clock = entry.get("monotonic_ns"), self._clock
        if clock is None or clock.uncertainty_ns > CLOCKS_NS or self._boot_id is None or self.at_ns is None:
            return None
        if not isinstance(written_ns, int):
            return None
        return written_ns - clock.offset_ns - self.at_ns + CLOCKS_NS + clock.uncertainty_ns

    def _read(self, entry: Mapping[str, Any], *, is_open: bool) -> None:
        what = entry.get("what")
        self._is_written |= what in HELD_BY or (what == AGAIN and "drive" not in entry)
        if what in HELD_BY:
            self._holds(entry)
        elif _is_reset(entry):
            if self._is_ended_by_reset and not is_open:
                self.was_reset(held=False, at_s=self._utc_s(entry))
            elif self.state is StopState.NOT_CONFIRMED:
                self.held, self.reason = False, ""

    @property
    def _is_ended_by_reset(self) -> bool:
        """Whether a reset in the journal is one of what is known to be held."""
        if self.state is StopState.IDLE:
            return self.held
        return self._is_written and self.state is not StopState.SENT

    def show(
        self, stamps_ns: Sequence[int], columns: Mapping[str, Sequence[str | None]], offset_ns: int
    ) -> None:
        """Take drives' states in words; `offset_ns` is the robot's clock minus ours.

        Rows that come late say of a drive whether it was enabled before the STOP.
        """
        if self.at_ns is None or self.state is StopState.IDLE:
            return
        for drive, words in columns.items():
            if drive not in self.proofs:
                self._prove(drive, stamps_ns, words, offset_ns, self.at_ns)
        if self.state is StopState.CONFIRMED:
            self._stand()
            self.text = self.timed(f"STOP confirmed by {self.every_drive}")

    def _prove(
        self, drive: str, stamps_ns: Sequence[int], words: Sequence[str | None], offset_ns: int, at_ns: int
    ) -> None:
        for stamp_ns, word in zip(stamps_ns, words, strict=True):
            after_ns = stamp_ns - offset_ns - at_ns
            if word == ENABLED:
                self._off.discard(drive)
            elif word is None or not is_off(word):
                continue
            elif after_ns < -self._sure_ns:
                self._off.add(drive)
            elif after_ns >= 0:
                proof = Proof(0.0 if drive in self._off else max(LEAST_MS, after_ns / 1e6), word)
                self.proofs[drive] = self._earliest(drive, proof)
                return

    @property
    def _sure_ns(self) -> int:
        """How much older than the STOP a row is at least, of which the clocks say that it is older."""
        return CLOCKS_NS + (0 if self._clock is None else self._clock.uncertainty_ns)

    def _earliest(self, drive: str, proof: Proof) -> Proof:
        """Return its proof, no later than the answer in which the drive itself has confirmed the STOP."""
        if self.answered_ms is None or drive not in self._confirmed:
            return proof
        return replace(proof, after_ms=min(proof.after_ms, self.answered_ms))

    @property
    def every_drive(self) -> str:
        return "the drive" if self.drives == 1 else f"all {self.drives} drives"

    def timed(self, confirmed: str) -> str:
        """Return the confirmation with its time: the slowest drive's, or the answer's if rows lack one.

        None of drives that were off when it was sent: they say nothing of how soon it acts.
        """
        after_ms = self.slowest_ms
        return f"{confirmed}, already off" if after_ms is None else f"{confirmed} in {after_ms:.0f} ms"

    @property
    def slowest_ms(self) -> float | None:
        """Time of the slowest drive that has confirmed it; None where those were off when it was sent."""
        asked = [drive for drive in self._confirmed if drive not in self._off]
        if not asked:
            return None
        after_ms = [proof.after_ms for drive in asked if (proof := self.proofs.get(drive)) is not None]
        is_shown = len(after_ms) == len(asked)
        return max(LEAST_MS, *(after_ms if is_shown else [self.answered_ms or 0.0]))

    @property
    def answered_ns(self) -> int:
        """When the drives' answers to the latest STOP came, on our clock; 0: they have not."""
        if self.at_ns is None or self.answered_ms is None:
            return 0
        return self.at_ns + round(self.answered_ms * 1e6)

    @property
    def held_ns(self) -> int:
        """Since when a stop is known to be held, on our clock: rows of before say nothing against it."""
        return max(self.answered_ns, self._heard_ns)

    @property
    def already_off(self) -> frozenset[str]:
        """The drives that have confirmed the latest STOP, and were off when it was sent."""
        return self.confirmed & self._off

    @property
    def confirmed(self) -> frozenset[str]:
        """The drives that have confirmed the latest STOP."""
        return frozenset(self._confirmed)

    @property
    def news(self) -> str:
        """What became of it, without a time: rows that come later may show a shorter one."""
        said = f"STOP confirmed by {self.every_drive}" if self.state is StopState.CONFIRMED else self.text
        return "; ".join(filter(None, (said, self.problem)))

    @property
    def proof(self) -> str:
        """Proof from the drives' own states: `6 drives confirmed in quick stop active within 3 ms`."""
        if not self.proofs:
            return ""
        slowest = max(LEAST_MS, *(proof.after_ms for proof in self.proofs.values()))
        by_state: dict[str, list[str]] = {}
        for drive, proof in self.proofs.items():
            by_state.setdefault(proof.state, []).append(drive)
        if len(by_state) == 1:
            (state,) = by_state
            return f"{counted(len(self.proofs), 'drive')} confirmed in {state} within {slowest:.0f} ms"
        told = (f"{_listed(drives)} in {state}" for state, drives in by_state.items())
        return f"drives confirmed within {slowest:.0f} ms: {'; '.join(told)}"

    @property
    def proof_lines(self) -> list[str]:
        """The same, a line a drive."""
        return [f"{_listed([drive])}: {proof.text}" for drive, proof in self.proofs.items()]

    @property
    def said(self) -> tuple[str, str]:
        """How the stop that is held came about, and by whose word where more is known than that."""
        own = self.text.removeprefix("STOP ") if self.state is StopState.CONFIRMED else ""
        return (own, self.reason) if own else (self.reason or "it is held until it is reset", "")

    def _holds(self, entry: Mapping[str, Any]) -> None:
        if not self.held or not self.reason:
            self.reason = _said(entry)
        if not self.held:
            self.problem = ""  # of one before
        if not self.held or self.since_s is None:
            self._stood_s = self._utc_s(entry)
            if self.state is not StopState.NOT_CONFIRMED:  # which is since ours, whoever holds another
                self.since_s = self._stood_s
        if not self.held and self.state is StopState.IDLE:
            self.proofs = {}  # of a STOP that is over: it is another one that is held
        self._hears(True)
        self.held, self.was_ended = True, False

    def _utc_s(self, entry: Mapping[str, Any]) -> float:
        """Return when it was written, on our calendar and never later than now; now where it does not say."""
        utc_ns = entry.get("utc_ns")
        now_s = time.time()
        return min(now_s, (utc_ns - self.calendar_ns) / 1e9) if isinstance(utc_ns, int) else now_s

    def _hears(self, held: bool) -> None:
        """Note since when the robot's word is known by which a stop is held; before it is `held`."""
        if held and not self.held:
            self._heard_ns = time.monotonic_ns()

    def _not_confirmed(self, why: str) -> None:
        self.state, self.why, self.since_s = StopState.NOT_CONFIRMED, why, self._sent_s
        self.text = f"STOP NOT CONFIRMED: {why}{'' if why.endswith('?') else '.'} Use the hardware stop"


def _said(entry: Mapping[str, Any]) -> str:
    """Return why it was stopped, and by whom."""
    who, reason = entry.get("who"), entry.get("reason")
    return ", ".join(filter(None, (str(reason or ""), f"by {who}" if who else "")))


def _is_reset(entry: Mapping[str, Any]) -> bool:
    """Return whether a stop ended with it."""
    return entry.get("what") == "reset" and not entry.get("held")


def _listed(names: Iterable[str]) -> str:
    return ", ".join(name.replace("_", " ") for name in names)
