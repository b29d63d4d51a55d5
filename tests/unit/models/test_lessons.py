"""What a training can learn from is told by wearer before it begins, as the training itself reads it."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ml.robot.groups import GROUPS
from ml.store import Store
from ml.store.labels import REGRESSION, LabelSource
from ml.training.dataset import Ask, LeftOut, SessionDecisions, part, versions
from server_gui.core.models.lessons import (
    NO_STRIDE,
    NOTHING,
    ONLY_JUDGES,
    SEVERAL,
    Lesson,
    Lessons,
    lessons,
)
from tests.unit.training.walkers import Made, Said, day, put

PERSON, SIMULATOR = LabelSource.PERSON, LabelSource.SIMULATOR


def stored(url: str, spool: Path, *days: Made) -> str:
    put(url, spool, days)
    return url


def of(url: str, spool: Path, *days: Made, task: str = "activity") -> dict[str, Lesson]:
    found = lessons(stored(url, spool, *days), task)
    assert not found.problem
    return {each.name: each for each in found.each}


def made(session: str, *said: Said, wearer: str = "", each_s: float = 5.0) -> Made:
    one = day(session, 1, each_s=each_s)
    return Made(session, one.values, said, wearer=wearer)


def strikes(*legs: str, begin_s: float = 4.0, count: int = 8) -> list[Said]:
    return [
        (begin_s + number, begin_s + number, f"{leg}_heel_strike", PERSON)
        for leg in legs
        for number in range(count)
    ]


def learned(url: str, each: Made, task: str = "activity") -> dict[str, int]:
    """Return the number of decisions of each class that a training has of a session."""
    recipe = f"{task}/hips+knees"
    found = part(Ask(url, versions(Store(url), ["exo"]), "exo", each.session, recipe))
    if isinstance(found, LeftOut):
        return {}
    assert isinstance(found, SessionDecisions)
    if found.truth.ndim == 1:
        return Counter(found.truth.tolist())
    still = np.isnan(found.truth).any(axis=1)
    return {"steps": int((~still).sum()), "no steps": int(still.sum())}


def assert_alike(told: dict[str, int], found: dict[str, int], most: int = 1) -> None:
    """The robot's clock may place the first decision a little later."""
    assert told.keys() >= found.keys()
    assert all(abs(told[name] - found.get(name, 0)) <= most for name in told), (told, found)


def test_one_wearer_however_spelled_is_one_and_what_two_have_labelled_counts_once(
    folder_url: str, tmp_path: Path
) -> None:
    found = of(
        folder_url,
        tmp_path / "spool",
        made("mon", (4.0, 8.0, "walk", PERSON), (6.0, 10.0, "walk", SIMULATOR), wearer="Ada L"),
        made("tue", (4.0, 7.0, "stand", PERSON), wearer="ada l"),
        made("wed", (4.0, 6.0, "stand", PERSON)),
    )
    assert found.keys() == {"Ada L", "wed"}
    ada = found["Ada L"]
    assert (ada.sessions, ada.is_named, ada.said) == (2, True, "walk 6.0 s, stand 3.0 s")
    assert not found["wed"].is_named


def test_spans_within_others_count_once_and_a_contradicted_time_not_at_all(
    folder_url: str, tmp_path: Path
) -> None:
    walk = (3.0, 13.0, "walk", PERSON)
    found = of(
        folder_url,
        tmp_path / "spool",
        made("nested", walk, (5.0, 7.0, "walk", PERSON), (6.0, 6.5, "walk", SIMULATOR)),
        made("side by side", (3.0, 5.0, "walk", PERSON), (5.0, 7.0, "walk", PERSON)),
        made("less trusted", walk, (5.0, 7.0, "stand", SIMULATOR), (12.0, 14.0, "stand", SIMULATOR)),
        made("contradicted", walk, (5.0, 7.0, "stand", PERSON)),
        made("by another word", walk, (5.0, 7.0, "lying", PERSON)),
    )
    assert {name: one.said for name, one in found.items()} == {
        "nested": "walk 10 s",
        "side by side": "walk 4.0 s",
        "less trusted": "walk 10 s, stand 1.0 s",
        "contradicted": "walk 8.0 s, stand: too short",
        "by another word": "walk 8.0 s",
    }


def test_labels_count_within_the_recording_and_from_its_first_decision_on(
    folder_url: str, tmp_path: Path
) -> None:
    late = made("late", (14.0, 100.0, "walk", PERSON), (50.0, 60.0, "stand", PERSON))
    early = made("early", (-50.0, 3.0, "walk", PERSON))
    found = of(folder_url, tmp_path / "spool", late, early)
    assert found["late"].said == "walk 0.8 s, stand: too short"
    assert found["early"].said == "walk 1.2 s", "the model looks back two seconds"
    for each in (late, early):
        assert_alike(dict(found[each.session].examples), learned(folder_url, each))


@pytest.mark.parametrize("task", ["activity", "gait_phase"])
def test_as_much_is_told_as_a_training_has(folder_url: str, tmp_path: Path, task: str) -> None:
    whole = day("whole", 1, strikes=True)
    other = replace(whole, session="other", said=[*whole.said, (9.0, 12.0, "fall", SIMULATOR)])
    found = of(folder_url, tmp_path / "spool", whole, other, task=task)
    for each in (whole, other):
        assert_alike(dict(found[each.session].examples), learned(folder_url, each, task), 2)


def test_a_label_without_a_decision_is_too_short(folder_url: str, tmp_path: Path) -> None:
    found = of(
        folder_url,
        tmp_path / "spool",
        made("mon", (4.0, 6.0, "walk", PERSON), (7.01, 7.04, "ramp_up", PERSON)),
        made("tue", (7.01, 7.04, "walk", PERSON)),
        made("wed", (0.0, 1.0, "walk", PERSON), each_s=0.5),
    )
    assert found["mon"].said == "walk 2.0 s, ramp: too short"
    assert found["tue"].said == NOTHING
    assert found["wed"].said == "it lasts 1.5 s, and the model looks back 2 s: left out"


def test_minutes_and_seconds_are_told_apart() -> None:
    lesson = Lesson("ada", "Ada", True, 1, {"walk": 1800, "stand": 890, "sit": 100, "turn": 3}, 0.1)
    assert lesson.said == "walk 3 min, stand 89 s, sit 10 s, turn 0.3 s"


def test_strides_take_two_strikes_of_each_leg_and_other_contacts_are_none(
    folder_url: str, tmp_path: Path
) -> None:
    toes = [(4.0 + at, 4.0 + at, "left_toe_off", PERSON) for at in range(5)]
    found = of(
        folder_url,
        tmp_path / "spool",
        made("both", *strikes("left", "right")),
        made("one leg", *strikes("left")),
        made("once", *strikes("left", "right", count=1)),
        made(
            "far apart", *strikes("left", "right", count=1), *strikes("left", "right", begin_s=9.0, count=1)
        ),
        made("standing", (4.0, 8.0, "stand", PERSON), *strikes("left", begin_s=9.0)),
        made("toes", *toes),
        task="gait_phase",
    )
    assert {name: one.said for name, one in found.items()} == {
        "both": "steps 7.0 s",
        "one leg": NO_STRIDE,
        "once": NO_STRIDE,
        "far apart": NO_STRIDE,
        "standing": "no steps 4.0 s, steps: too few foot contacts",
    }


def test_what_nothing_is_learned_from_says_why(folder_url: str, tmp_path: Path) -> None:
    found = of(
        folder_url,
        tmp_path / "spool",
        made("mon", (4.0, 8.0, "walk", PERSON), (0.0, 9.0, "wearer Bob", PERSON), wearer="Ada"),
        made("tue", (4.0, 7.0, "stand", PERSON), (0.0, 9.0, REGRESSION, PERSON)),
        made("wed", (4.0, 7.0, "lying on the floor", PERSON)),
        replace(made("thu", (4.0, 7.0, "walk", PERSON)), channels=GROUPS["hips"], values=np.zeros((1500, 2))),
    )
    knees = ", ".join(GROUPS["knees"])
    assert {name: one.said for name, one in found.items()} == {
        "mon": SEVERAL,
        "tue": ONLY_JUDGES,
        "thu": f"it has no {knees}: left out",
    }


ADA_AND_BOB: Sequence[Said] = [(0.0, 9.0, "wearer Ada", PERSON), (0.0, 9.0, "wearer Bob", PERSON)]


@pytest.mark.parametrize(
    ("label", "more", "why"),
    [
        ((4.0, 8.0, "walk", PERSON), ADA_AND_BOB, SEVERAL),
        ((4.0, 8.0, "walk", PERSON), [], ONLY_JUDGES),
        ((7.01, 7.04, "walk", PERSON), ADA_AND_BOB, NOTHING),
    ],
)
def test_of_several_reasons_the_one_is_told_that_a_training_finds_first(
    folder_url: str, tmp_path: Path, label: Said, more: Sequence[Said], why: str
) -> None:
    """A regression set of several wearers does not even judge: the training leaves it out."""
    each = made("mon", label, (0.0, 9.0, REGRESSION, PERSON), *more)
    assert of(folder_url, tmp_path / "spool", each)["mon"].said == why
    assert bool(learned(folder_url, each)) is (why == ONLY_JUDGES)


def test_what_only_a_model_has_said_teaches_nothing(folder_url: str, tmp_path: Path) -> None:
    found = of(
        folder_url,
        tmp_path / "spool",
        made("mon", (4.0, 8.0, "walk", LabelSource.PSEUDO), wearer="Ada"),
        made(
            "tue",
            (4.0, 7.0, "stand", PERSON),
            (6.0, 9.0, "walk", LabelSource.PSEUDO),
            (10.0, 11.0, "stand", PERSON),
            wearer="Bob",
        ),
    )
    assert {name: one.said for name, one in found.items()} == {"Bob": "stand 4.0 s"}


def test_who_judges_is_who_would_where_nobody_is_chosen(folder_url: str, tmp_path: Path) -> None:
    found = lessons(
        stored(folder_url, tmp_path, *(day(f"s{n}", n, each_s=5.0) for n in range(4))), "activity"
    )
    usual = found.judges()
    assert not usual.problem
    assert len(usual.names) == 1
    assert usual.names <= {each.name for each in found.each}
    steps = lessons(folder_url, "gait_phase").judges()
    assert steps.problem == "there are 0 examples of steps: 20 are needed at least"
    nothing = lessons(folder_url, "activity", "another")
    assert nothing.each == ()
    assert nothing.judges().problem.startswith("no session of another ")


def taught(**examples: dict[str, int]) -> Lessons:
    each = tuple(Lesson(who, who, who != "nobody", 1, own, 0.1) for who, own in examples.items())
    return Lessons(each, "activity/hips+knees")


def test_who_is_chosen_judges_if_enough_are_left_to_learn_from() -> None:
    both = {"walk": 50, "stand": 50}
    found = taught(ada=both, bob=both, cid=both, nobody=both)
    assert found.judges(["ada"]).names == {"ada"}
    assert found.judges(["ada", "bob"]).names == {"ada", "bob"}
    assert "it takes two to learn from" in found.judges(["ada", "bob", "cid"]).problem
    assert "nobody is called 'nobody'" in found.judges(["nobody"]).problem


def test_classes_of_which_too_few_teach_are_told_before() -> None:
    both = {"walk": 50, "stand": 10}
    found = taught(ada=both | {"sit": 30}, bob=both, cid=both)
    assert found.judges(["cid"]).left_out == ()
    assert found.judges(["ada"]).left_out == ()
    few = taught(ada=both | {"sit": 19, "stairs_up": 0}, bob=both, cid=both)
    assert few.judges(["cid"]).left_out == ("sit is left out: 19 examples; it takes 20",)
    judge = taught(ada=both | {"sit": 15}, bob=both, cid=both | {"sit": 15})
    assert judge.judges(["cid"]).left_out == ("sit is left out: 15 examples; it takes 20",), (
        "a judge's teach not"
    )
    alone = taught(ada={"walk": 50}, bob={"walk": 50, "sit": 19}, cid=both)
    assert "needs examples of two classes" in alone.judges(["cid"]).problem


@pytest.mark.parametrize("url", ["file:///nowhere/at/all", "s4://nobody"])
def test_a_store_that_is_not_there_is_said(url: str) -> None:
    found = lessons(url, "activity")
    assert found.problem
    assert found.judges().problem == found.problem
