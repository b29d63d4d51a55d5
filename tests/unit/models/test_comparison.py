"""Models beside one another: what is better is said, and what is not known is never a number."""

import dataclasses
from datetime import UTC, datetime
from typing import Any

import pytest

from ml.registry.card import Bin, Card, ClassScore, DataSource, Metrics
from server_gui.core.models.catalogue import Catalogue, Entry
from server_gui.core.models.comparison import (
    Row,
    headline,
    last_week,
    notes,
    percent,
    rows,
    signed,
    unknown_to,
    usual_other,
    week_short,
)
from server_gui.core.models.names import model_names
from server_gui.core.prediction.state import Quality

MADE = datetime(2026, 11, 3, 14, 20, tzinfo=UTC)


def card(model: str = "activity-0123456789ab", **changes: Any) -> Card:
    fields: dict[str, Any] = {
        "id": model,
        "task": model.rpartition("-")[0],
        "recipe": "activity/hips",
        "classes": ("stand", "walk"),
        "channels": ("left_hip.position",),
        "units": {"left_hip.position": "rad"},
        "features_hash": "",
        "source": DataSource.RECORDED,
        "seed": 0,
        "made": MADE,
        "versions": {},
    }
    return Card(**(fields | changes))


def entry(model: str = "activity-0123456789ab", serving: str = "", **changes: Any) -> Entry:
    made = card(model, **changes)
    return Entry(made, model, False, (), serving)


def judged(f1: float, ada: float, error: float | None = 0.04) -> Metrics:
    return Metrics(
        figures={"macro_f1": f1, "abstained": 0.1},
        per_class={"walk": ClassScore(1.0, 1.0, f1, 40), "fall": ClassScore(0.0, 0.0, 0.0, 0)},
        per_subject={"Ada": ada},
        calibration=(Bin(0.9, 0.8, 40),),
        calibration_error=error,
    )


def found(one: Metrics, other: Metrics | None) -> dict[tuple[str, str], Row]:
    second = None if other is None else card(metrics=other)
    return {(row.group, row.name): row for row in rows(card(metrics=one), second)}


def test_more_f1_is_better_and_more_error_worse() -> None:
    both = found(judged(0.9, 0.9, 0.06), judged(0.8, 0.95, 0.04))
    assert both["On people never seen", "F1, mean over classes"].verdict == "better"
    assert both["By class, F1", "walk"].verdict == "better"
    assert both["By wearer, F1", "Ada"].verdict == "worse"
    assert both["On people never seen", "Probabilities are off by"].verdict == "worse"
    assert both["On people never seen", "Says “unknown”"].verdict == "alike"


def test_a_difference_is_that_of_the_figures_as_they_are_shown() -> None:
    row = found(judged(0.90049, 0.9), judged(0.89951, 0.9))["On people never seen", "F1, mean over classes"]
    assert (percent(row.one), percent(row.other), signed(row.difference)) == ("90.0 %", "90.0 %", "±0.0")


def test_a_class_that_nobody_showed_has_no_figure_instead_of_zero() -> None:
    row = found(judged(0.9, 0.9), None)["By class, F1", "fall"]
    assert (row.one, row.other, row.decisions) == (None, None, 0)
    assert (percent(row.one), signed(row.difference), row.verdict) == ("–", "–", "")


def test_the_error_of_a_phase_is_less_when_it_is_better() -> None:
    one, other = (
        Metrics(figures={"rmse_percent": value}, per_subject={"Ada": value}) for value in (2.0, 3.0)
    )
    both = {row.name: row for row in rows(card(metrics=one), card(metrics=other))}
    assert both["Error, of the gait cycle"].verdict == "better"
    assert both["Ada"].verdict == "better"
    assert (both["Ada"].one, headline(card(metrics=one))) == (2.0, "error 2.0 %")


def test_last_week_is_not_known_where_nobody_has_labelled_it() -> None:
    unknown = entry()
    assert last_week(unknown) == "not known: nobody has labelled any of what it said within 7 days"
    assert week_short(unknown) == "not labelled"
    quality = Quality(200, 192, 6, 2, {}, seconds=200, recordings=2)
    known = Entry(card(), "a", False, (), "", {"exo-01": quality})
    assert last_week(known) == "exo-01: 96.0 % right, 3.0 % wrong, 1.0 % not said of 3 min in 2 recordings"
    assert week_short(known) == "96.0 % of 3 min"


def test_labels_of_one_class_alone_prove_nothing_of_the_others() -> None:
    """A detector of falls was 100 % right in a week without a fall."""
    steady = Quality(200, 200, 0, 0, {"steady": {"steady": 200}}, seconds=200, recordings=2)
    one = Entry(card(classes=("steady", "near_fall", "fall")), "a", False, (), "", {"exo-01": steady})
    assert week_short(one) == "only steady labelled"
    assert last_week(one).endswith("in 2 recordings; no label says near fall, fall")
    both = Quality(4, 4, 0, 0, {"steady": {"steady": 2}, "fall": {"fall": 2}})
    two = dataclasses.replace(one, hits={"exo-01": steady, "exo-02": both})
    assert week_short(two) == "exo-01 only steady labelled, exo-02 too little labelled to tell"


def test_the_worst_of_one_wearer_is_no_figure_of_its_own() -> None:
    figures = {"macro_f1": 0.9, "covered": 0.99, "worst_subject_covered": 0.99}
    alone = card(metrics=Metrics(figures=figures, per_subject={"s3": 0.9}))
    assert "The same, for the worst wearer" not in {row.name for row in rows(alone, None)}
    two = card(metrics=Metrics(figures=figures, per_subject={"s3": 0.9, "s4": 0.8}))
    assert "The same, for the worst wearer" in {row.name for row in rows(two, None)}


def test_judges_that_differ_or_are_known_already_are_pointed_out() -> None:
    one = entry(held_out=("mon",))
    other = entry("activity-ba9876543210", held_out=("tue",), learned=("mon", "wed"))
    assert [note.split(",")[0] for note in notes(one, other)] == [
        "Each was judged on sessions of its own",
        "activity-ba9876543210 has learned from 1 session that judged the other.",
    ]
    assert list(notes(one, entry("activity-1", held_out=("mon",)))) == []


def test_figures_that_were_judged_by_other_sessions_have_no_difference_and_no_verdict() -> None:
    one, other = (
        card(metrics=judged(f1, f1), held_out=(session,)) for f1, session in ((0.939, "mon"), (0.971, "tue"))
    )
    known = {row.name: row for row in rows(one, other)}
    assert signed(known["F1, mean over classes"].difference) == "–"
    assert known["F1, mean over classes"].verdict == "not comparable"
    assert {row.difference for row in known.values()} == {None}
    assert known["fall"].verdict == "", "neither has a figure"


def test_classes_that_only_the_other_knows_are_named() -> None:
    one, other = entry(), entry("activity-1", classes=("stand", "walk", "sit_to_stand", "turn"))
    said = unknown_to(one.card, [other.card], "the other")
    assert said.startswith("It does not know sit to stand, turn; the other does.")
    assert not unknown_to(other.card, [one.card], "the other"), "it knows all that the other knows"


@pytest.mark.parametrize(
    ("serving", "expected"),
    [("activity-b", "activity-b"), ("activity-a", "activity-c"), ("", "activity-c"), ("gone", None)],
)
def test_a_model_is_compared_with_what_serves_else_with_the_newest_of_its_task(
    serving: str, expected: str | None
) -> None:
    chosen = entry("activity-a", serving)
    entries = (entry("falling-x"), entry("activity-c"), chosen, entry("activity-b"))
    other = usual_other(chosen, Catalogue(entries))
    assert (None if other is None else other.card.id) == expected


def test_names_are_words_and_two_that_are_alike_are_told_apart() -> None:
    one, twin = card("activity-5f0c00000000"), card("activity-77aa00000000")
    own = card("gait_phase-1", robot="exo-01")
    shipped = card("falling-2")
    names = model_names((one, twin, own, shipped), {"falling-2"})
    day = f"{MADE.astimezone():%d %b %Y %H:%M}".lstrip("0")
    assert list(names.values()) == [
        f"Activity of {day} (5f0c)",
        f"Activity of {day} (77aa)",
        f"Gait phase of {day}, for exo-01",
        "Falling, came with GWRMS",
    ]
