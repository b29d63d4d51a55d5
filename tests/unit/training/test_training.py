"""Training on recorded sessions: what is learned, what the card says, and by whom it is judged."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from msgspec import structs

from ml.errors import UnusableData, UnusableModel
from ml.registry.card import DataSource
from ml.registry.registry import Registry
from ml.store.labels import REGRESSION, LabelSource
from ml.training.judging import Verdict
from ml.training.training import Trained, train
from ml.training.training_sessions import Wish
from tests.unit.training.walkers import CHANNELS, MOTIONS, Made, day, late_walk, put

pytestmark = pytest.mark.usefixtures("small_models")
ACTIVITY = Wish("activity")
HELD_OUT = "s3"  # by the hash of its name


@pytest.fixture(scope="module")
def people() -> list[Made]:
    return [day(f"s{number}", number, strikes=True) for number in range(5)]


@pytest.fixture(scope="module")
def url(people: list[Made], store_libraries: None, tmp_path_factory: pytest.TempPathFactory) -> str:
    """A store of five people who stand, walk and sit."""
    return stored(tmp_path_factory.mktemp("people"), people)


def stored(folder: Path, sessions: Sequence[Made]) -> str:
    url = (folder / "store").as_uri()
    put(url, folder / "spool", sessions)
    return url


def registry_of(url: str) -> Registry:
    """Without the models that come with GWRMS: those would serve."""
    return Registry(url, shipped=Path("/nowhere"))


@pytest.fixture(scope="module")
def trained(url: str) -> Trained:
    return train(registry_of(url), ACTIVITY)


def test_it_is_judged_by_people_that_it_has_not_learned_from(trained: Trained) -> None:
    assert trained.card.held_out == (HELD_OUT,)
    assert trained.card.learned == ("s0", "s1", "s2", "s4")
    figures = trained.held_out.new.figures
    assert figures["macro_f1"] > 0.85
    assert 0.8 < figures["worst_subject_covered"] <= figures["covered"] <= 1.0
    assert figures["promised_covered"] > 0.5
    assert figures["promised_wearers"] < 0.9, "there are too few to promise more"
    assert trained.decision.verdict is Verdict.NOT_COMPARED
    assert trained.serving == ""


def test_its_card_says_from_what_it_was_made(trained: Trained, url: str) -> None:
    card = trained.card
    assert (card.task, card.recipe, card.channels) == ("activity", "activity/hips+knees", CHANNELS)
    assert set(card.classes) == {"stand", "walk", "sit"}
    assert {(table.store, table.location) for table in card.tables} == {
        (url, "telemetry/000"),
        (url, "labels"),
        (url, "sessions"),
    }
    assert card.source is DataSource.RECORDED
    assert card.notes == "learned from decisions labelled by: person 880"
    assert card.metrics.per_subject.keys() == {HELD_OUT}
    low, high = card.ranges["left_knee.position"]
    assert -0.2 < low < 0.1
    assert 1.5 < high < 1.7
    assert "there is no regression set" in trained.remarks[0]


def test_the_same_tables_give_the_same_model_and_that_is_not_better_than_itself(
    trained: Trained, url: str
) -> None:
    registry = registry_of(url)
    model = registry.publish(trained.learned.state(), trained.card)
    registry.promote(model, who="ada", why="a test")
    again = train(registry_of(url), ACTIVITY)
    assert registry.publish(again.learned.state(), again.card) == model
    assert again.serving == model
    assert not again.decision.better
    assert again.held_out.serving == again.held_out.new


def test_pseudo_labels_are_marked_and_never_judge(
    trained: Trained, people: list[Made], tmp_path: Path
) -> None:
    mine = stored(tmp_path, [*people[:4], replace(people[4], said=[], session="s9")])
    wish = Wish("activity", pseudo=0.9)
    with pytest.raises(UnusableData, match="no pseudo-labels for activity: no model serves"):
        train(registry_of(mine), wish)
    registry = registry_of(mine)
    registry.promote(registry.publish(trained.learned.state(), trained.card), who="ada", why="a teacher")
    taught = train(registry_of(mine), wish)
    counts = dict(part.split() for part in taught.card.notes.partition(": ")[2].split(", "))
    assert counts["person"] == "660"
    assert 100 < int(counts["pseudo"]) < 220
    assert "s9" in taught.card.learned
    assert taught.card.held_out == (HELD_OUT,)  # s9 has no label of anybody, and judges nothing
    assert taught.held_out.decisions == 220


def test_other_sessions_judge_and_teach_and_a_rare_class_is_left_out(
    people: list[Made], tmp_path: Path
) -> None:
    fixed = [*people[4].said, (0.0, 24.0, REGRESSION, LabelSource.PERSON)]
    (_, _, stand, person), *others = people[0].said
    rare = [(0.0, 4.0, stand, person), (4.0, 5.0, "stairs_up", person), (5.0, 8.0, stand, person), *others]
    mine = stored(
        tmp_path,
        [
            replace(people[0], said=rare),
            *people[1:4],
            replace(people[4], said=fixed),
            replace(people[4], session="s5", values=people[4].values[:150]),
            replace(people[4], session="s6", wearer="P1"),
            replace(people[4], session="s7", wearer="P1"),
        ],
    )
    found = train(registry_of(mine), Wish("activity", held_out=("P1",)))
    assert found.card.held_out == ("s4", "s6", "s7")
    assert found.regression is not None
    assert found.regression.people == {"s4": 220}
    rare_class, unnamed = found.remarks
    assert rare_class == "stairs_up is left out: 10 examples; it takes 20"
    assert unnamed.startswith(
        "sessions without a wearer's name, beside others with one: 4; they are left out"
    )
    assert [(each.ask.session, each.why) for each in found.left_out] == [
        ("s5", "it lasts 1.5 s: activity/hips+knees looks back 2 s")
    ]


def test_no_wearer_is_on_both_sides_and_nobody_knows_whose_is_no_judge(
    people: list[Made], tmp_path: Path
) -> None:
    names = ("P01", "p01 ", "P-01", "P02", "P03")
    named = [replace(each, wearer=name) for each, name in zip(people, names, strict=True)]
    mine = stored(tmp_path, [*named, replace(people[0], session="whose")])
    found = train(registry_of(mine), Wish("activity", held_out=("P1",)))
    assert found.card.held_out == ("s0", "s1", "s2")
    assert found.held_out.people == {"p1": 660}
    assert "beside others with one: 1;" in found.remarks[0]
    with pytest.raises(UnusableData, match=r"nobody is called 'whose'.*1 sessions that do not say whose"):
        train(registry_of(mine), Wish("activity", held_out=("whose",)))


def test_nobody_knows_whose_is_no_judge_where_nobody_was_named(people: list[Made], tmp_path: Path) -> None:
    named = [replace(each, wearer=f"P{number}") for number, each in enumerate(people)]
    mine = stored(tmp_path, [*named, replace(people[0], session="whose")])
    assert "whose" not in train(registry_of(mine), ACTIVITY).card.held_out


def test_a_serving_model_with_other_sensors_judges_the_same_decisions(
    people: list[Made], tmp_path: Path
) -> None:
    hips = CHANNELS[:2]
    mine = stored(tmp_path, [replace(each, values=each.values[:, :2], channels=hips) for each in people])
    poor = train(registry_of(mine), ACTIVITY)
    assert poor.card.channels == hips
    rich = stored(tmp_path / "rich", people)
    registry = registry_of(rich)
    registry.promote(registry.publish(poor.learned.state(), poor.card), who="ada", why="a test")
    found = train(registry_of(rich), ACTIVITY)
    assert found.serving.startswith("activity-")
    assert found.held_out.serving is not None
    assert found.held_out.decisions == 220
    assert found.held_out.serving.figures == pytest.approx(poor.held_out.new.figures, abs=0.2)
    assert f"the serving model has learned from {HELD_OUT}" not in str(found.remarks)


# --- a wearer's own gait


@pytest.fixture(scope="module")
def walker(people: list[Made], url: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """A store with somebody whose legs are late, and a model of other people's phase."""
    odd = day("odd", 9, ("stand", "walk"), each_s=90.0, strikes=True, motions={**MOTIONS, "walk": late_walk})
    short = day("short", 9, ("walk",), each_s=70.0, strikes=True)
    mine = stored(tmp_path_factory.mktemp("walker"), [odd, replace(short, robot="other")])
    general = train(registry_of(url), Wish("gait_phase"))
    assert general.held_out.new.figures["rmse_percent"] < 4.0
    return mine, registry_of(mine).publish(general.learned.state(), general.card)


def test_a_minute_of_a_wearer_cuts_the_error_of_his_later_walking(walker: tuple[str, str]) -> None:
    url, base = walker
    found = train(registry_of(url), Wish("gait_phase", robot="exo", adapt_from=base))
    assert found.held_out.serving is not None
    before, after = (each.figures["rmse_percent"] for each in (found.held_out.serving, found.held_out.new))
    assert before > 8.0
    assert after < 0.6 * before
    assert found.decision.better
    assert (found.card.robot, found.card.parent) == ("exo", base)
    assert found.remarks[0].startswith("adapting cuts the error of the later walking by ")
    # Nothing that judges has taught: each minute is sixty seconds of steps.
    assert 450 < found.held_out.decisions < 520
    registry = registry_of(url)
    model = registry.publish(found.learned.state(), found.card)
    with pytest.raises(UnusableModel, match="was adapted to exo"):
        registry.promote(model, who="ada", why="for all")
    registry.promote(model, "exo", who="ada", why="his own")
    assert registry.serving("gait_phase", "exo") == model


@pytest.mark.parametrize(
    ("wish", "error", "words"),
    [
        (Wish("gait_phase", adapt_from="{base}"), UnusableData, "name it with --robot"),
        (Wish("activity", robot="exo", adapt_from="{base}"), UnusableData, "activity is not adapted"),
        (Wish("gait_phase", robot="other", adapt_from="{base}"), UnusableData, r"there are 6\d s of steps"),
        (Wish("gait_phase", robot="exo", adapt_from="gait_phase-0"), UnusableModel, "there is no model.json"),
        (Wish("gait_phase", robot="nobody", adapt_from="{base}"), UnusableData, "no session of nobody in"),
    ],
)
def test_what_cannot_be_adapted_is_said_so(
    walker: tuple[str, str], wish: Wish, error: type[Exception], words: str
) -> None:
    url, base = walker
    with pytest.raises(error, match=words):
        train(registry_of(url), structs.replace(wish, adapt_from=wish.adapt_from.format(base=base)))
