"""The events of one recording for its time axis: marks, the robot's journal, and changes of its drives."""

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from typing import Any, Final

from server_gui.core.cloud.tape import Rows, Tape
from server_gui.core.desk.flags import Entry, Flag, Flags, StateWatch, of_events, of_recorded_journal
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

    def tell(self, entries: Iterable[Entry]) -> None:
        """Take entries of the robot's journal from the time of the recording."""
        if self._tape is not None:
            begin_ns, end_ns = self._tape.first_ns, self._tape.last_ns
            self.flags.add(
                *(flag for flag in of_recorded_journal(entries) if begin_ns <= flag.at_ns <= end_ns)
            )

    @property
    def is_looking(self) -> bool:
        """Whether more may be found."""
        return self._tape is not None and not self.problem and self.until_ns <= self._tape.last_ns

    def next(self, after_ns: int) -> Flag | None:
        """Return the first after an instant."""
        return next((flag for flag in self.flags if flag.at_ns > after_ns), None)

    def last(self, before_ns: int) -> Flag | None:
        """Return the last before an instant."""
        return next((flag for flag in reversed(list(self.flags)) if flag.at_ns < before_ns), None)

    def _look(self, tape: Tape, words: Words, watch: StateWatch) -> None:
        begin_ns, states = self.until_ns, [name for name in tape.units if name in words]
        if not states or begin_ns > tape.last_ns:
            self.until_ns = tape.last_ns + 1
            return
        when_done(
            self._read(lambda: tape.read(begin_ns, begin_ns + PIECE_NS, states)),
            self._deliver,
            lambda rows: self._looked(tape, words, watch, rows),
            lambda error: self._failed(watch, error),
        )

    def _looked(self, tape: Tape, words: Words, watch: StateWatch, rows: Rows) -> None:
        if watch is self._watch:  # what was asked before the same recording was opened again is not
            columns = {name: column.tolist() for name, column in rows.columns.items()}
            self.flags.add(*watch.take(rows.utc_ns.tolist(), columns, words))
            self.until_ns += PIECE_NS
            self._look(tape, words, watch)

    def _failed(self, watch: StateWatch, error: Exception) -> None:
        if watch is self._watch:
            self.problem = str(error)
