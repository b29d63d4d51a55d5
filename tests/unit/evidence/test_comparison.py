"""The words for an edit: better, worse, changed, no difference seen, not enough cycles, no data."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from server_gui.core.evidence.comparison import Evidence, Measured, Spell, Word, compare
from server_gui.core.evidence.curves import curves
from tests.unit.evidence.synthetic import AT_S, SECOND, cycles, spell

ERROR, TORQUE, TEMPERATURE = "left_knee.error_rms", "left_knee.torque_rms", "left_knee.temperature"
JOINTS = ("left_knee", "right_knee")

Change = Callable[[float, dict[str, float]], None]


def times(series: str, factor: float) -> Change:
    """From the edit on."""

    def change(at_s: float, values: dict[str, float]) -> None:
        values[series] *= factor if at_s >= AT_S else 1.0

    return change


def metric(evidence: Evidence, series: str) -> Measured:
    return next(one for one in evidence.metrics if one.series == series)


def nothing(at_s: float, values: dict[str, float]) -> None:
    """As it was."""


@pytest.mark.parametrize(
    ("change", "series", "word", "verdict"),
    [
        (nothing, ERROR, Word.SAME, Word.SAME),
        (times(ERROR, 1.2), ERROR, Word.WORSE, Word.WORSE),
        (times(ERROR, 0.8), ERROR, Word.BETTER, Word.BETTER),
        (times(TORQUE, 1.2), TORQUE, Word.CHANGED, Word.CHANGED),
        (times("cadence", 0.85), "cadence", Word.CHANGED, Word.CHANGED),
        (times(ERROR, 1.03), ERROR, Word.SAME, Word.SAME),  # surely so, and nobody feels it
    ],
)
def test_a_word_for_each_way(change: Change, series: str, word: Word, verdict: Word) -> None:
    evidence = compare(cycles(change), spell(), JOINTS, ["left_knee"])
    assert metric(evidence, series).word is word
    assert evidence.word is verdict
    assert evidence.strongest == (series if word is not Word.SAME else "")


def test_better_and_worse_together_are_mixed() -> None:
    def change(at_s: float, values: dict[str, float]) -> None:
        times(ERROR, 0.7)(at_s, values)
        values["left_knee.current_rms"] = 2.0 * (1.3 if at_s >= AT_S else 1.0) + 0.01 * (at_s % 3.0)

    assert compare(cycles(change), spell(), JOINTS).word is Word.MIXED


def test_numbers_are_what_was_done() -> None:
    found = metric(compare(cycles(times(ERROR, 1.2)), spell(), JOINTS), ERROR)
    assert found.difference == pytest.approx(0.001, rel=0.25)
    assert found.low is not None
    assert found.high is not None
    assert 0.0 < found.low < 0.001 < found.high
    assert found.before == pytest.approx(0.005, rel=0.02)
    assert found.after == pytest.approx(0.006, rel=0.02)
    assert found.size is not None
    assert found.size > 5.0


@pytest.mark.parametrize("seed", range(5))
def test_a_drift_before_the_edit_is_not_its_effect(seed: int) -> None:
    def tiring(at_s: float, values: dict[str, float]) -> None:
        values[ERROR] *= 1.0 + 0.5 * at_s / 120.0
        values[TEMPERATURE] += 0.02 * at_s

    evidence = compare(cycles(tiring, seed=seed), spell(), JOINTS)
    assert evidence.word is Word.SAME
    assert (metric(evidence, ERROR).after or 0.0) > 1.15 * (metric(evidence, ERROR).before or 0.0)


def test_heat_is_seen_by_its_slope() -> None:
    def heating(at_s: float, values: dict[str, float]) -> None:
        values[TEMPERATURE] += 0.01 * at_s + 0.04 * max(0.0, at_s - AT_S)

    found = metric(compare(cycles(heating), spell(), JOINTS), TEMPERATURE)
    assert found.word is Word.WORSE
    assert found.before == pytest.approx(0.01, abs=0.004)
    assert found.after == pytest.approx(0.05, abs=0.004)


def test_going_back_tells_a_drift_apart_that_bends_at_the_edit() -> None:
    """Friction that begins to grow with the edit by chance, and goes on when that is taken back."""

    def change(at_s: float, values: dict[str, float]) -> None:
        values[ERROR] *= 1.0 + 0.004 * max(0.0, at_s - 50.0)

    back = Spell([*spell().before, (111 * SECOND, 170 * SECOND)], [(61 * SECOND, 110 * SECOND)])
    assert metric(compare(cycles(change, until_s=170.0), back, JOINTS), ERROR).word is Word.SAME


def test_few_cycles_say_so_and_how_many() -> None:
    evidence = compare(cycles(times(ERROR, 2.0), until_s=68.0), spell(), JOINTS)
    assert evidence.word is Word.FEW
    assert evidence.strongest == ""
    assert evidence.cycles_before >= 40, "what is there is told, also where it is too few on the other side"
    assert 0 < evidence.cycles_after < 8


def test_what_nothing_tells_has_no_data() -> None:
    evidence = compare(cycles(), spell(), JOINTS)
    assert metric(evidence, "left_knee.lag").word is Word.NO_DATA
    assert metric(evidence, "bus_load").word is Word.NO_DATA
    assert metric(evidence, "right_knee.error_rms").word is Word.FEW  # the right leg was not seen at all


def test_standing_says_nothing() -> None:
    assert compare([], spell(), JOINTS).word is Word.FEW


def test_only_strides_of_equal_length_are_compared() -> None:
    """Faster strides have larger errors: that they became faster is told, and not the joint's fault."""

    def change(at_s: float, values: dict[str, float]) -> None:
        values["cadence"] = 100.0 * (1.3 if at_s >= AT_S else 1.0) + at_s % 1.0
        values[ERROR] *= 1.5 if at_s >= AT_S else 1.0

    evidence = compare(cycles(change, stride_s=lambda at_s: 0.92 if at_s >= AT_S else 1.2), spell(), JOINTS)
    assert metric(evidence, ERROR).word is Word.FEW
    assert "same speed" in metric(evidence, ERROR).why
    assert metric(evidence, "cadence").word is Word.CHANGED
    assert any("equally long" in note for note in evidence.notes)


def test_only_the_same_activity_is_compared() -> None:
    """Stairs after the edit, and a walk before it, say nothing of the edit; nor does the way between."""

    def change(at_s: float, values: dict[str, float]) -> None:
        values[ERROR] *= 3.0 if at_s >= AT_S + 30.0 else 1.0

    def activity(at_s: float) -> str | None:
        if 88.0 <= at_s < 92.0:
            return None
        return "stairs" if at_s >= AT_S + 30.0 else "walk"

    evidence = compare(cycles(change, activity=activity), spell(), JOINTS)
    assert evidence.word is Word.SAME
    assert evidence.left_out["the activity changed"] >= 3


def test_strides_of_no_common_activity_are_told_with_theirs() -> None:
    """Models say nothing while a window begins: 40 cycles that do not count want a reason."""
    evidence = compare(cycles(activity=lambda at_s: "walk" if at_s >= AT_S else ""), spell(), JOINTS)
    assert evidence.word is Word.FEW
    (note,) = evidence.notes
    found = rf"{evidence.cycles_before} not known before, {evidence.cycles_after} walk after"
    assert note == f"too few cycles of one activity on both sides: {found}"


def test_strides_of_another_activity_are_not_drawn_either() -> None:
    """Stairs laid over a walk would look like what the edit did."""
    taken = [
        dataclasses.replace(
            cycle, curves={"left_knee.position": np.full(101, float(cycle.activity == "stairs"))}
        )
        for cycle in cycles(activity=lambda at_s: "stairs" if at_s >= AT_S + 30.0 else "walk")
    ]
    (found,) = curves(taken, spell(), ["left_knee"])
    assert found.before is not None
    assert found.after is not None
    assert found.after.mean == found.before.mean


def test_cycles_are_left_out_with_their_reason() -> None:
    taken = [
        dataclasses.replace(cycle, values={"cadence": 100.0}, left_out={"left_knee": "values are missing"})
        if cycle.began_ns >= 66 * SECOND
        else cycle
        for cycle in cycles()
    ]
    evidence = compare(taken, spell(), JOINTS)
    assert metric(evidence, ERROR).word is Word.FEW
    assert evidence.left_out["left_knee: values are missing"] > 40


@pytest.mark.parametrize(("known", "word"), [("cadence", Word.NO_DATA), (ERROR, Word.FEW)])
def test_what_is_not_known_of_the_edited_joint_is_not_no_difference(known: str, word: Word) -> None:
    """The cadence is as it was; of the knee that was edited nothing is known, or of a few strides only."""

    def lost(at_s: float, values: dict[str, float]) -> None:
        for series in list(values):
            if series.startswith("left_knee") and (series != known or at_s >= AT_S + 5.0):
                del values[series]

    evidence = compare(cycles(lost), spell(), JOINTS, ["left_knee"])
    assert metric(evidence, "cadence").word is Word.SAME
    assert evidence.word is word


@pytest.mark.parametrize(
    ("before", "after", "word"),
    [
        (-0.02, -0.01, Word.BETTER),
        (-0.01, -0.02, Word.WORSE),
        (0.01, -0.02, Word.WORSE),
        (0.02, -0.02, Word.CHANGED),
    ],
)
def test_a_lead_is_no_better_than_a_lag(before: float, after: float, word: Word) -> None:
    def change(at_s: float, values: dict[str, float]) -> None:
        values["left_knee.lag"] = (after if at_s >= AT_S else before) + 1e-4 * (at_s % 1.0)

    assert metric(compare(cycles(change), spell(), JOINTS), "left_knee.lag").word is word


def test_strides_since_it_was_taken_back_are_told_apart() -> None:
    """They have the old values, and count with those before."""
    back_ns = round((AT_S + 31.0) * SECOND)
    reverted = Spell([(0, round(AT_S * SECOND)), (back_ns, 120 * SECOND)], spell(AT_S + 30.0).after)
    found = compare(cycles(), reverted, JOINTS)
    since_back = sum(cycle.began_ns >= back_ns and cycle.ended_ns <= 120 * SECOND for cycle in cycles())
    assert found.cycles_back == since_back > 20
    assert found.cycles_before - found.cycles_back == compare(cycles(), spell(), JOINTS).cycles_before
    assert compare(cycles(), spell(), JOINTS).cycles_back == 0
