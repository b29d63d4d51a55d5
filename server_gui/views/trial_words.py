"""What is on trial, in words: the same wherever a trial is shown."""

from gateway.units import Units
from server_gui.core.desk.station import Station
from server_gui.core.evidence.comparison import Word
from server_gui.core.evidence.file import Told
from server_gui.core.evidence.wording import share
from server_gui.core.tuning.edits import unit_of
from server_gui.core.tuning.writing import Trial


def changes(station: Station, trial: Trial, units: Units) -> list[str]:
    """Return each value with the one from before: `gait step length 400 → 430 mm`."""
    said = []
    for name, value in trial.values.items():
        info = station.known.get(name)
        unit = unit_of(name, "" if info is None else info.unit, units)
        before = trial.before.get(name)
        old = "?" if before is None else unit.editable(before)
        short = name.replace("_", " ").replace(".", " ")
        said.append(f"{short} {old} → {unit.editable(value)} {unit.symbol}".rstrip())
    return said


def so_far(edit: Told | None) -> str:
    """Return what it did until now, in one clause."""
    if edit is None:
        return "what it does is seen once somebody walks"
    evidence = edit.evidence
    if evidence.word is Word.FEW:
        return f"{evidence.cycles_after} gait cycles until now: not enough to judge it"
    strongest = next((one for one in evidence.metrics if one.series == evidence.strongest), None)
    what = "" if strongest is None else f" ({strongest.title.replace('_', ' ')} {share(strongest)})"
    return f"so far {evidence.word}{what}"


def ends(trial: Trial) -> str:
    """Return when it goes back."""
    left_s = trial.left_s()
    return f"taken back in {left_s:.0f} s" if left_s else "its time is over: reading …"
