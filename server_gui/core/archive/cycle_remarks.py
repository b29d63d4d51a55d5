"""What the gait cycles of two recordings say of a curve: the measures of edits, first and second."""

from collections.abc import Iterator
from typing import Final, TypeVar

from gateway.units import Units
from ml.store.sessions import Session
from server_gui.core.archive.recording_comparison import RecordingComparison
from server_gui.core.evidence.comparison import FEWEST, Measured, Word
from server_gui.core.evidence.wording import from_to

OF_QUANTITIES: Final = {
    "position": "error_rms",
    "following_error": "error_rms",
    "torque": "torque_rms",
    "current": "current_rms",
    "temperature": "temperature",
}
CADENCE: Final = "cadence"
DIFFERENT: Final = "differs"
BEGIN: Final = "per gait cycle: "
Value = TypeVar("Value")


class CycleRemarks:
    """Texts for one look at a comparison; the values of `first` come first, whichever is older."""

    def __init__(self, compared: RecordingComparison, first: Session, units: Units) -> None:
        self._found = compared.moved
        self._problem = compared.problem
        self._is_turned = compared.pair is not None and compared.pair[0] is not first
        self._units = units

    def of(self, channel: str) -> tuple[str, ...]:
        """Return what is said of a channel, the fullest wording first; nothing where nothing is measured."""
        component, _, quantity = channel.rpartition(".")
        key = OF_QUANTITIES.get(quantity)
        one = next((one for one in self._metrics() if one.series == f"{component}.{key}"), None)
        return () if one is None else self._said(one)

    @property
    def cadence(self) -> tuple[str, ...]:
        """How fast both walked, or why that is not known, the fullest wording first."""
        if self._found is None:
            why = f"gait cycles are not compared: {self._problem}"
            return (why, "gait cycles not known", "") if self._problem else ("gait cycles: reading …", "")
        one = next((one for one in self._metrics() if one.series == CADENCE), None)
        counts = self._turned(self._found.cycles_before, self._found.cycles_after)
        cycles = f"gait cycles of both legs: {counts[0]} and {counts[1]}"
        brief = f"cycles {counts[0]} and {counts[1]}:"
        said = (
            () if one is None else (f"{cycles}, {text.removeprefix(BEGIN)}" for text in self._said(one)[:2])
        )
        if self._found.word is Word.FEW and min(counts) >= 2 * FEWEST:
            notes = [f"{cycles}; {note}" for note in self._found.notes[:1]]
            return (*said, *notes, f"{cycles}, too few of them are alike", f"{brief} too few alike", "")
        judged = f"{cycles}: {self._found.word}"
        if self._found.word is Word.FEW:
            return (*said, f"{judged}, it takes {FEWEST} of each leg", judged, f"{brief} too few", "")
        return (*said, judged, cycles, "")

    def _metrics(self) -> Iterator[Measured]:
        found = () if self._found is None else self._found.metrics
        return (one for one in found if one.before is not None and one.after is not None)

    def _said(self, one: Measured) -> tuple[str, ...]:
        unit = self._units.unit("", one.unit)
        values = (None if value is None else value * unit.scale for value in (one.before, one.after))
        told = f"{one.title} {from_to(*self._turned(*values))} {unit.symbol}".rstrip()
        word = DIFFERENT if one.word in (Word.BETTER, Word.WORSE, Word.CHANGED) else str(one.word)
        return f"{BEGIN}{told}, {word}", f"{BEGIN}{told}", told, ""

    def _turned(self, before: Value, after: Value) -> tuple[Value, Value]:
        return (after, before) if self._is_turned else (before, after)
