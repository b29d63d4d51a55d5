"""Result of an experiment: its record, verdict and strides, in the form of an edit's evidence."""

import hashlib
from collections.abc import Sequence
from typing import Final

from msgspec.structs import replace

from server_gui.core.evidence.comparison import Evidence, Spell
from server_gui.core.evidence.curves import Curves, curves, told_joints
from server_gui.core.evidence.edits import ID, Edit, EditState, ParameterChange
from server_gui.core.evidence.experiment import Experiment
from server_gui.core.evidence.file import EditEvidence
from server_gui.core.experiments.machine import ExperimentState as Stands
from server_gui.core.experiments.plan import ExperimentKind, signs
from server_gui.core.experiments.response import Swept, respond
from server_gui.core.experiments.run import Run
from server_gui.core.experiments.verdict import judge

LEFT_OUT: Final = "right after a change"


def result(run: Run, who: str, unit: str, session: str = "") -> EditEvidence | None:
    """Return the record of a finished experiment; None if nothing was written.

    It was run by whom the robot's journal names as the author of its trials, as for any other edit; by `who`
    where the journal was not read.
    """
    if run.state is Stands.NOTHING_DONE:
        return None
    plan, held = run.plan, [one for _, one in run.periods]
    swept: Swept | None = None
    drawn: tuple[Curves, ...] = ()
    if plan.kind is ExperimentKind.AB:
        evidence = judge((plan.values[0], plan.values[1]), signs(plan), held, run.joints, run.edited)
        drawn = _curves(run, evidence)
    else:
        swept = respond(held, run.joints, run.edited, plan.original)
        evidence = swept.evidence
    counted = {**evidence.left_out, LEFT_OUT: run.transients} if run.transients else evidence.left_out
    kept = Experiment(
        kind=plan.kind.value,
        parameter=plan.name,
        unit=unit,
        original=plan.original,
        values=plan.values,
        cycles=plan.dwell.cycles,
        transient=plan.dwell.transient,
        seconds=plan.dwell.seconds,
        seed=plan.seed,
        periods=tuple(period for period, _ in run.periods),
        ended=run.why,
        is_back=run.state is Stands.OVER,
        back=f"{run.state.value}: {run.back}",
        error_bound=run.watch.bounds.error,
        current_bound=run.watch.bounds.current,
        responses=swept.responses if swept else (),
        judged_by=swept.judged_by if swept else "",
        proposal=swept.proposal if swept else None,
        reason=swept.reason if swept else "",
        writes=tuple(run.writes),
    )
    told = replace(evidence, left_out=counted)
    return EditEvidence(_edit(run, who), told, is_final=True, session=session, curves=drawn, experiment=kept)


def _edit(run: Run, who: str) -> Edit:
    """Return the one edit that represents all trials of an experiment."""
    plan = run.plan
    first, last = plan.values[0], plan.values[-1]
    name = hashlib.sha256(f"{run.robot} {run.boot_id} {run.utc_ns} {plan.name}".encode()).hexdigest()[:ID]
    periods = [period for period, _ in run.periods]
    return Edit(
        id=name,
        robot=run.robot,
        n=0,
        write=periods[0].write if periods else 0,
        boot_id=run.boot_id,
        who=run.watch.who or who,
        utc_ns=run.utc_ns,
        changes=(ParameterChange(plan.name, first, last),),
        trial_s=plan.dwell.trial_s,
        began_ns=periods[0].began_ns if periods else 0,
        state=EditState.REVERTED if run.state is Stands.OVER else EditState.ASKED,
        in_force_ns=periods[0].began_ns if periods else None,
        ended_ns=periods[-1].ended_ns if periods else None,
    )


def _curves(run: Run, evidence: Evidence) -> tuple[Curves, ...]:
    spans = [
        [(each.began_ns, each.ended_ns) for each, _ in run.periods if each.value == value]
        for value in run.plan.values
    ]
    spell = Spell(spans[0], spans[1])
    cycles = [cycle for _, held in run.periods for cycle in held.cycles]
    joints: Sequence[str] = told_joints(evidence, run.edited)
    return curves(cycles, spell, joints)
