"""A trial in words: the same wherever it is shown."""

import operator
from typing import Final

from gateway.amounts import counted
from gateway.units import Units
from server_gui.core.desk.station import Station
from server_gui.core.evidence.comparison import FEWEST, Evidence, Word
from server_gui.core.evidence.edits import SETTLE_NS
from server_gui.core.evidence.wording import share
from server_gui.core.tuning.edits import spoken, unit_of
from server_gui.core.tuning.writing import Trial

TO_AB: Final = "Take it back now, and ask about an A/B trial of both values"
AB_OF_ONE: Final = "An A/B trial is of one parameter, and {} are on trial: take them back, and try one"
UNLIKE: Final = "too few strides before and after are comparable"


def changes(station: Station, trial: Trial, units: Units) -> list[str]:
    """Return each value with the one from before: `step length (gait) 400 → 430 mm`."""
    return [f"{name} {values}" for name, values in _changes(station, trial, units)]


def wordings(station: Station, trial: Trial, units: Units) -> tuple[str, ...]:
    """Return the wordings for less and less room: each value whole, with the number of further ones."""
    first, *others = _changes(station, trial, units)
    said = changes(station, trial, units)
    full = ", ".join(said)
    if not others:
        return f"On trial: {full}", full, first[1]
    some = [f"{', '.join(said[:count])} and {len(said) - count} more" for count in range(len(others), 0, -1)]
    return f"On trial: {full}", full, *some, f"{len(said)} values"


def why_no_ab(trial: Trial) -> str:
    """Return why it cannot become an A/B trial; empty where it can."""
    count = len(trial.values)
    return "" if count == 1 else AB_OF_ONE.format(count)


def so_far(station: Station) -> tuple[str, ...]:
    """Return its effect so far in one clause: `so far worse: left knee tracking error RMS +45.0 %`.

    Then the same for where there is less and less room.
    """
    if station.writing.failed_ask:
        return (station.writing.why_failed,)
    edit = station.trial_evidence
    if edit is None:
        walks = station.is_live and station.processing.derived().gait.walking
        return ("not judged yet",) if walks else ("its effect shows once the wearer walks", "not judged yet")
    evidence = edit.evidence
    if evidence.word is Word.FEW:
        said = _not_enough(evidence)
        return said, said.partition(":")[0]
    brief = f"so far {evidence.word}"
    strongest = next((one for one in evidence.metrics if one.series == evidence.strongest), None)
    if strongest is None:
        return (brief,)
    return (
        f"{brief}: {strongest.title.replace('_', ' ')} {share(strongest)}",
        f"{brief}: {share(strongest)}",
        brief,
    )


def is_judged(station: Station) -> bool:
    """Return whether it is known what the trial did: before that no button is the one that is meant."""
    edit = station.trial_evidence
    return edit is not None and edit.evidence.word is not Word.FEW


def _not_enough(evidence: Evidence) -> str:
    """Return that it is too early, or what keeps strides from being counted."""
    before, after = evidence.cycles_before, evidence.cycles_after
    if min(before, after) >= 2 * FEWEST:
        most = sorted(evidence.left_out.items(), key=operator.itemgetter(1), reverse=True)
        left_out = [f"{counted(count, 'gait cycle')} left out, {why}" for why, count in most]
        return f"cannot be judged so far: {[*left_out, *evidence.notes, UNLIKE][0]}"
    if after >= 2 * FEWEST > before:
        need = f"{counted(before, 'gait cycle')}, and it takes {FEWEST} of each leg"
        return f"too few cycles before it: {need}; those after it is taken back count, too"
    strides = f"{counted(before, 'gait cycle')} before, {after} since"
    return f"too early to judge it: {strides}; it takes {FEWEST} of each leg, before and since"


def verdict_takes(station: Station) -> tuple[str, ...]:
    """Return how long a trial takes to be judged at this cadence; nothing where nobody walks."""
    gait = station.processing.derived().gait
    if not station.is_live or not gait.walking or not gait.cadence_spm:
        return ()
    seconds = SETTLE_NS / 1e9 + FEWEST * 2 * 60.0 / gait.cadence_spm
    said = f"a verdict takes about {seconds:.0f} s"
    return f"{said}: {FEWEST} cycles of each leg", said


def ends(station: Station, trial: Trial) -> str:
    """Return when it goes back, after what has failed that somebody asked of it."""
    left_s, failed = trial.left_s(), station.writing.failed_ask
    end = f"taken back in {left_s:.0f} s" if left_s else "its time is over: reading …"
    if not left_s and not station.is_linked:
        end = "its time is over: not known, no link"
    return f"{failed}; {end}" if failed else end


def _changes(station: Station, trial: Trial, units: Units) -> list[tuple[str, str]]:
    """Return the name, and the values before and now, of each parameter."""
    found = []
    for name, value in trial.values.items():
        info = station.known.get(name)
        unit = unit_of(name, "" if info is None else info.unit, units)
        before = trial.before.get(name)
        old = "?" if before is None else unit.editable(before)
        values = f"{old} → {unit.editable(value)} {unit.symbol}".rstrip()
        found.append((spoken(name), values))
    return found
