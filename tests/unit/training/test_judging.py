"""Who may serve: better on people nobody knows, and nowhere much worse."""

from typing import Any

import pytest
from msgspec.structs import replace

from ml.errors import UnusableData
from ml.registry.card import ClassScore, Metrics
from ml.robot.task import TASKS
from ml.store.labels import person
from ml.training.data_split import held_out, recipe_for
from ml.training.judging import Judged, Verdict, decide

ACTIVITY, PHASE = TASKS["activity"], TASKS["gait_phase"]
USUAL = Metrics(
    figures={"macro_f1": 0.8, "abstained": 0.05, "idle": 0.2},
    per_class={name: ClassScore(0.8, 0.8, 0.8, 100) for name in ("walk", "stand")},
    per_subject={"ada": 0.8, "bob": 0.8},
    calibration_error=0.03,
)
WALKING = Metrics(figures={"rmse_percent": 6.0, "abstained": 0.05, "idle": 28.9}, per_subject={"ada": 6.0})
PEOPLE = {"ada": 100, "bob": 100}


def judged(new: Metrics, serving: Metrics | None, name: str = "held-out people") -> Judged:
    return Judged(name, 200, new, serving, PEOPLE)


def better(metrics: Metrics = USUAL, **figures: float) -> Metrics:
    return replace(metrics, figures=metrics.figures | {"macro_f1": 0.82, "rmse_percent": 5.5} | figures)


def test_what_is_better_and_nowhere_much_worse_may_serve() -> None:
    decision = decide(ACTIVITY, judged(better(), USUAL), judged(USUAL, USUAL, "regression set"))
    assert decision.better
    assert decision.why == ("macro_f1 on held-out people: 82.0 %, the serving model's 80.0 %",)


def test_figures_that_differ_a_little_are_told_with_digits_enough_to_see_it() -> None:
    decision = decide(ACTIVITY, judged(better(macro_f1=0.8002), USUAL), None)
    assert decision.why == ("macro_f1 on held-out people: 80.02 %, the serving model's 80.00 %",)


def test_as_good_is_not_better() -> None:
    decision = decide(ACTIVITY, judged(USUAL, USUAL), None)
    assert not decision.better
    assert "80.0 %: not better" in decision.why[0]


WORSE_CLASS = {"walk": ClassScore(0.9, 0.9, 0.9, 100), "stand": ClassScore(0.7, 0.7, 0.7, 100)}


@pytest.mark.parametrize(
    ("new", "words"),
    [
        (replace(better(), per_class=WORSE_CLASS), "F1 of stand falls by 10.0 points"),
        (replace(better(), per_subject={"ada": 0.9, "bob": 0.7}), "bob loses 10.0 points"),
        (replace(better(), calibration_error=0.2), "calibration_error rises by 17.0 points"),
        (better(abstained=0.4), "abstained rises by 35.0 points"),
    ],
)
@pytest.mark.parametrize("where", ["held-out people", "regression set"])
def test_much_worse_anywhere_is_enough_not_to_serve(new: Metrics, words: str, where: str) -> None:
    people = judged(new if where == "held-out people" else better(), USUAL)
    fixed = judged(new, USUAL, where) if where == "regression set" else None
    decision = decide(ACTIVITY, people, fixed)
    assert not decision.better
    assert decision.why[1:] == (f"much worse in the {where}: {words}",)


def test_few_decisions_are_no_reason() -> None:
    rare = {name: replace(score, support=5) for name, score in WORSE_CLASS.items()}
    new = replace(better(), per_class=rare, per_subject={"ada": 0.9, "bob": 0.1})
    old = replace(
        USUAL, per_class={name: replace(score, support=5) for name, score in USUAL.per_class.items()}
    )
    assert decide(ACTIVITY, Judged("held-out people", 105, new, old, {"ada": 100, "bob": 5}), None).better


def test_of_a_phase_the_error_must_fall() -> None:
    new = better(WALKING)
    assert decide(PHASE, judged(new, WALKING), None).better
    assert not decide(PHASE, judged(WALKING, new), None).better
    worse = replace(new, per_subject={"ada": 8.0})
    assert "ada loses 2.0 points" in decide(PHASE, judged(worse, WALKING), None).why[1]


@pytest.mark.parametrize(("figures", "serves"), [({"macro_f1": 0.3}, True), ({"macro_f1": 0.2}, False)])
def test_the_first_model_must_know_more_than_nothing(figures: Any, serves: bool) -> None:
    decision = decide(ACTIVITY, judged(better(**figures), None), None)
    assert decision.verdict is (Verdict.NOT_COMPARED if serves else Verdict.NOT_BETTER)
    assert (decision.may_serve, decision.better) == (serves, False), (
        "nothing is better than what is not there"
    )
    ours = f"{100 * figures['macro_f1']:.1f} %"
    assert decision.why == (
        f"macro_f1 {ours} on ada and bob alone, whom it has not seen (always guessing the same: 20.0 %)",
        "not compared with another: no promoted model serves yet",
    )


def test_what_came_with_gwrms_and_cannot_judge_these_sessions_is_named() -> None:
    lacking = ("imu.roll", "imu.yaw", "left_insole.force", "right_insole.force")
    decision = decide(ACTIVITY, judged(better(), None), None, lacking)
    assert not decision.better
    assert decision.why[1] == (
        "not compared with the model that came with GWRMS: these sessions lack 4 of its channels "
        "(imu.roll, imu.yaw, left_insole.force, …)"
    )


def test_where_nothing_could_be_judged_nothing_is_promoted() -> None:
    assert not decide(ACTIVITY, Judged("held-out people", 0, Metrics(), Metrics()), None).better


def test_who_is_held_out_stays_so_when_others_come() -> None:
    few = [f"P{number:02}" for number in range(12)]
    held = held_out(few)
    assert 1 <= len(held) <= 6
    assert held <= held_out([*few, *(f"Q{number:02}" for number in range(12))])
    assert held_out(few, ["P03"]) == {"P03"}


@pytest.mark.parametrize(
    "spelled", ["P01", "p01", "P01 ", "P-01", " p_01", "P 1", "\uff30\uff10\uff11", "P.01"]
)
def test_one_wearer_is_one_person_however_he_is_spelled(spelled: str) -> None:
    assert person(spelled) == "p1"
    assert held_out(["p1", "p2", "p3"], [spelled]) == {"p1"}


def test_different_wearers_stay_different_people() -> None:
    names = [
        "P1",
        "P10",
        "P100",
        "1-11",
        "11-1",
        "111",
        "0",
        "Ada",
        "Jos\u00e9",
        "Jose",
        "\u0915\u093f",
        "\u0915\u093e",
    ]
    assert len({person(name) for name in names}) == len(names)
    assert person(" - ") == person("") == ""


@pytest.mark.parametrize(
    ("groups", "wanted", "words"),
    [
        (["P1", "P2"], [], r"wearers or sessions with labels: P1, P2; it takes two to learn"),
        ([], [], "with labels: none"),
        (["P1"], [], "one to judge by: record more people, label .* SESSION --wearer NAME"),
        (["P1", "P2", "P3"], ["P1", "P2"], "one to judge by: hold out fewer"),
        (["P1", "P2", "P3"], ["P1", "P2"], "it takes two to learn from and one to judge by"),
        (["P1", "P2", "P3"], ["P9"], "nobody is called 'P9'; there are P1, P2, P3"),
    ],
)
def test_too_few_people_are_said_so(groups: list[str], wanted: list[str], words: str) -> None:
    with pytest.raises(UnusableData, match=words):
        held_out(groups, wanted)


def test_one_poor_robot_does_not_make_all_models_poor() -> None:
    rich = {f"{side}_{joint}.position" for side in ("left", "right") for joint in ("hip", "knee", "ankle")}
    poor = {name for name in rich if "ankle" not in name}
    assert recipe_for(ACTIVITY, [rich, rich, poor]).name == "activity/hips+knees+ankles"
    assert recipe_for(ACTIVITY, [rich, poor, poor]).name == "activity/hips+knees"
    with pytest.raises(UnusableData, match="no session has the channels that activity takes"):
        recipe_for(ACTIVITY, [{"left_knee.position"}])
