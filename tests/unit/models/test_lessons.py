"""What a training can learn from is told by wearer before it begins, as the training itself reads it."""

from pathlib import Path

import pytest

from ml.store.labels import REGRESSION, LabelSource
from server_gui.core.models.lessons import ONLY_JUDGES, SEVERAL, Lesson, lessons
from tests.unit.training.walkers import Made, day, put

PERSON = LabelSource.PERSON


def of(url: str, spool: Path, *days: Made) -> dict[str, Lesson]:
    put(url, spool, days)
    found = lessons(url, "activity")
    return {each.name: each for each in found.each}


def made(session: str, *said: tuple[float, float, str, LabelSource], wearer: str = "") -> Made:
    one = day(session, 1, each_s=5.0)
    return Made(session, one.values, said, wearer=wearer)


def test_one_wearer_however_spelled_is_one_and_what_two_have_labelled_counts_once(
    folder_url: str, tmp_path: Path
) -> None:
    found = of(
        folder_url,
        tmp_path / "spool",
        made("mon", (0.0, 4.0, "walk", PERSON), (2.0, 6.0, "walk", LabelSource.SIMULATOR), wearer="Ada L"),
        made("tue", (0.0, 3.0, "stand", PERSON), wearer="ada l"),
        made("wed", (0.0, 2.0, "stand", PERSON)),
    )
    assert found.keys() == {"Ada L", "wed"}
    ada = found["Ada L"]
    assert (ada.sessions, ada.is_named, ada.said) == (2, True, "walk 0:06, stand 0:03")
    assert not found["wed"].is_named


def test_what_nothing_is_learned_from_says_why(folder_url: str, tmp_path: Path) -> None:
    found = of(
        folder_url,
        tmp_path / "spool",
        made("mon", (0.0, 4.0, "walk", PERSON), (0.0, 9.0, "wearer Bob", PERSON), wearer="Ada"),
        made("tue", (0.0, 3.0, "stand", PERSON), (0.0, 9.0, REGRESSION, PERSON)),
        made("wed", (0.0, 3.0, "lying on the floor", PERSON)),
    )
    assert {each.said for each in found.values()} == {SEVERAL, ONLY_JUDGES}


def test_what_only_a_model_has_said_teaches_nothing(folder_url: str, tmp_path: Path) -> None:
    found = of(
        folder_url,
        tmp_path / "spool",
        made("mon", (0.0, 4.0, "walk", LabelSource.PSEUDO), wearer="Ada"),
        made("tue", (0.0, 3.0, "stand", PERSON), (3.0, 9.0, "walk", LabelSource.PSEUDO), wearer="Bob"),
    )
    assert {name: one.said for name, one in found.items()} == {"Bob": "stand 0:03"}


def test_who_judges_is_who_would_where_nobody_is_chosen(folder_url: str, tmp_path: Path) -> None:
    days = [day(f"s{number}", number, each_s=5.0) for number in range(4)]
    put(folder_url, tmp_path / "spool", days)
    found = lessons(folder_url, "activity")
    assert not found.problem
    assert len(found.usual) == 1
    assert found.usual <= {each.name for each in found.each}
    assert lessons(folder_url, "gait_phase").problem.startswith("wearers or sessions with labels: none; ")
    assert lessons(folder_url, "activity", "another").each == ()


@pytest.mark.parametrize("url", ["file:///nowhere/at/all", "s4://nobody"])
def test_a_store_that_is_not_there_is_said(url: str) -> None:
    assert lessons(url, "activity").problem
