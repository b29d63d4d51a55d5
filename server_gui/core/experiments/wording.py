"""An experiment in words: the same in the terminal and in the window. Values are SI."""

from collections.abc import Collection, Iterator, Sequence
from typing import Final

from gateway.amounts import counted
from server_gui.core.evidence.experiment import Experiment, Point
from server_gui.core.evidence.file import EditEvidence
from server_gui.core.evidence.wording import changes, number
from server_gui.core.experiments.machine import ExperimentState
from server_gui.core.experiments.plan import ExperimentKind, ExperimentPlan
from server_gui.core.experiments.run import Run

BAR: Final = 24  # letters


def stated(plan: ExperimentPlan) -> Iterator[str]:
    """Yield the plan in words, before it begins."""
    dwell = plan.dwell
    each = counted(dwell.cycles, "gait cycle") if dwell.seconds is None else f"{dwell.seconds:g} s"
    left_out = counted(dwell.transient, "gait cycle")
    yield f"{plan.kind.value} of {plan.name}, which is {plan.said(plan.original)}"
    if plan.kind is ExperimentKind.AB:
        first, second = map(plan.said, plan.values)
        pairs = len(plan.steps) // 2
        yield f"  {pairs} pairs of {first} (A) and {second} (B), order drawn with seed {plan.seed}"
    else:
        steps = [plan.unit.brief(step.value) + ("" if step.is_measured else "*") for step in plan.steps]
        way = "; * only on the way" if any("*" in one for one in steps) else ""
        yield f"  {', '.join(steps)} {plan.unit.symbol}".rstrip() + way
    yield f"  each for {each}, {left_out} after each change left out: about {minutes(plan.expected_s(1.2))}"
    yield (
        "  it ends at once, and the original value comes back, with any new alarm or warning of the guard, a "
        "STOP, a trial that is refused or taken back, a write of others, a lost link, when nobody walks, "
        "beyond the bounds, and when you say so"
    )


def minutes(seconds: float) -> str:
    """About how long, for people."""
    return f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"


def progress(run: Run) -> str:
    """Return its progress, in a line."""
    plan = run.plan
    what = f"{plan.kind.value} of {plan.name}"
    if run.state is ExperimentState.LOOKING:
        return f"{what}: {ExperimentState.LOOKING.value} …"
    if run.is_over:
        return f"{what}: {ending(run)}"
    if run.state is not ExperimentState.HOLDING:
        return f"{what}: {run.state.value} …"
    step = plan.steps[run.place]
    held = (
        f"{run.cycles} of {counted(plan.dwell.cycles, 'gait cycle')}"
        if plan.dwell.seconds is None
        else (counted(run.cycles, "gait cycle"))
    )
    return (
        f"{what}: {plan.said(step.value)} ({run.place + 1} of {len(plan.steps)}), {held}; "
        f"about {minutes(run.left_s)} left; back by itself in {run.trial_left_s:.0f} s"
    )


def ending(run: Run) -> str:
    """Return how it has ended."""
    early = f"ended early: {run.why}; " if run.why else ""
    back = f" ({run.back})" if run.back else ""
    return f"{early}{run.state.value}{back}"


def what(told: EditEvidence) -> str:
    """Return the changed parameters: of an experiment all its values."""
    one = told.experiment
    if one is None:
        return changes(told.edit)
    values = [number(value) for value in one.values]
    if one.kind == ExperimentKind.AB:
        return f"{one.parameter} A/B {values[0]} or {values[-1]}"
    return f"{one.parameter} sweep {values[0]} … {values[-1]}"


def whole(found: Sequence[EditEvidence], writes: Collection[int] = ()) -> list[EditEvidence]:
    """Return the same without edits that are only a part of an experiment; of one that goes on: `writes`."""
    parts = {
        (told.edit.robot, told.edit.boot_id, write)
        for told in found
        if told.experiment is not None
        for write in (*told.experiment.writes, *(period.write for period in told.experiment.periods))
    }
    return [
        told
        for told in found
        if told.experiment
        or not (told.edit.write in writes or (told.edit.robot, told.edit.boot_id, told.edit.write) in parts)
    ]


def record(one: Experiment) -> Iterator[str]:
    """Yield the course of an experiment and its end, in words."""
    cycles = counted(one.cycles, "gait cycle") if one.seconds is None else f"{one.seconds:g} s"
    drawn = f", order drawn with seed {one.seed}" if one.seed is not None else ""
    held = " ".join(number(period.value) for period in one.periods)
    yield f"{counted(len(one.periods), 'period')} of {cycles}{drawn}: {held or 'none was whole'}"
    if one.ended:
        yield f"ended early: {one.ended}"
    yield f"{'' if one.is_back else 'ERROR: '}{one.back}"
    if one.reason:
        yield f"proposal: {number(one.proposal)}: {one.reason}" if one.proposal is not None else one.reason


def chart(one: Experiment) -> Iterator[tuple[str, ...]]:
    """Yield of each value of a sweep what the judged metric was, with a bar; nothing where none was."""
    judged = next((each for each in one.responses if each.series == one.judged_by), None)
    if judged is None:
        return
    low = min(point.low for point in judged.points)
    high = max(point.high for point in judged.points)
    for point in judged.points:
        mark = "proposed" if point.value == one.proposal else "held" if point.value == one.original else ""
        interval = f"{number(point.low)} … {number(point.high)}"
        yield (
            number(point.value),
            number(point.mean),
            interval,
            _bar(point, low, high),
            str(point.cycles),
            mark,
        )


def _bar(point: Point, low: float, high: float) -> str:
    """Return the interval as a line, the mean as a dot on it."""
    span = (high - low) or 1.0
    first, at, last = (round((each - low) / span * (BAR - 1)) for each in (point.low, point.mean, point.high))
    return "".join("●" if place == at else "─" if first <= place <= last else " " for place in range(BAR))
