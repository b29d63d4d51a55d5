"""The events of one recording for its time axis: marks, the robot's journal, and changes of its drives."""

import copy
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from typing import Any, Final

from gateway.wire.parameter import ParameterInfo
from server_gui.core.cloud.tape import Rows, Tape
from server_gui.core.desk.flags import (
    Entry,
    FlagKind,
    Flags,
    StateWatch,
    code_of,
    of_events,
    of_recorded_journal,
)
from server_gui.core.threads.answers import Deliver, when_done

PIECE_NS: Final = (
    300_000_000_000  # that are looked through at once: who plays the recording waits for no more
)
Words = Mapping[str, Mapping[str, str]]


class TimelineEvents:
    """For the window's thread; `read` does what it is given in another one. Instants are UTC in ns."""

    def __init__(self, read: Callable[[Callable[[], Any]], "Future[Any]"], deliver: Deliver) -> None:
        self.flags = Flags()
        self.problem = ""  # why not everything is known
        self.until_ns = 0  # up to here the drives' states have been looked through
        self._tape: Tape | None = None
        self._watch = StateWatch()
        self._read = read
        self._deliver = deliver

    def open(self, tape: Tape, words: Words) -> None:
        """Find out of another recording; `words` are those of its channels that are states."""
        self._tape, self.problem, self.until_ns = tape, "", tape.first_ns
        self.flags.clear()
        self.flags.add(*of_events(tape.events))
        self._watch = StateWatch()
        self._look(tape, words, self._watch)

    def tell(self, entries: Iterable[Entry], described: Iterable[ParameterInfo] = ()) -> None:
        """Take entries of the robot's journal from the time of the recording, with its parameters."""
        if self._tape is not None:
            begin_ns, end_ns = self._tape.first_ns, self._tape.last_ns
            found = of_recorded_journal(entries, described)
            self.flags.add(*(flag for flag in found if begin_ns <= flag.at_ns <= end_ns))

    @property
    def is_looking(self) -> bool:
        """Whether more may be found."""
        return self._tape is not None and not self.problem and self.until_ns <= self._tape.last_ns

    def _look(self, tape: Tape, words: Words, watch: StateWatch, *, coded: bool = False) -> None:
        """Look through a piece: with the drives' error codes only where one falls into a fault."""
        begin_ns, states = self.until_ns, [name for name in tape.units if name in words]
        if not states or begin_ns > tape.last_ns:
            self.until_ns = tape.last_ns + 1
            return
        codes = _codes(tape, states) if coded else []
        when_done(
            self._read(lambda: tape.read(begin_ns, begin_ns + PIECE_NS, [*states, *codes])),
            self._deliver,
            lambda rows: self._looked(tape, words, watch, rows, coded=coded),
            lambda error: self._failed(watch, error),
        )

    def _looked(self, tape: Tape, words: Words, watch: StateWatch, rows: Rows, *, coded: bool) -> None:
        if watch is self._watch:  # what was asked before the same recording was opened again is not
            columns = {name: column.tolist() for name, column in rows.columns.items()}
            before = copy.deepcopy(watch)
            found = list(watch.take(rows.utc_ns.tolist(), columns, words))
            if not coded and _codes(tape, columns) and any(flag.kind is FlagKind.FAULT for flag in found):
                self._watch = before
                self._look(tape, words, before, coded=True)
                return
            self.flags.add(*found)
            self.until_ns += PIECE_NS
            self._look(tape, words, watch)

    def _failed(self, watch: StateWatch, error: Exception) -> None:
        if watch is self._watch:
            self.problem = str(error)


def _codes(tape: Tape, states: Iterable[str]) -> list[str]:
    return [code for state in states if (code := code_of(state)) in tape.units]
