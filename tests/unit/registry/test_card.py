"""A card: which robots it is for, the code of its features, and how the model was judged."""

import dataclasses
import linecache
import re
from collections.abc import Callable
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from sklearn.metrics import confusion_matrix, f1_score, precision_recall_fscore_support

from ml.errors import UnusableModel
from ml.features.gait_status import GAIT_STATUS
from ml.features.recipe import Recipe
from ml.registry import code
from ml.registry.card import age_days, check_robot, content_id, decoded, encoded
from ml.registry.classifier_scores import judged
from ml.registry.code import features_hash
from tests.unit.registry.models import card, learned


def units(changes: dict[str, str] | None = None) -> dict[str, str]:
    return card(learned()).units | {"left_knee.position": "rad"} | (changes or {})


def test_a_card_is_read_as_it_was_written() -> None:
    made = card(learned(), learned=("20261121T1530",), notes="two lines\nö", ranges={"trunk": (-1.0, 2.5)})
    named = msgspec.structs.replace(made, id=content_id(made))
    assert decoded(encoded(named)) == named
    assert age_days(named, named.made + timedelta(hours=36)) == pytest.approx(1.5)


@pytest.mark.parametrize("data", [b"", b"[]", b'{"task": "\xff"}', b'{"task": ' + b"[" * 100_000])
def test_what_is_no_card_is_refused(data: bytes) -> None:
    with pytest.raises(UnusableModel, match=r"model\.json is no model's card"):
        decoded(data)


def test_a_robot_with_the_same_channels_and_units_is_taken() -> None:
    check_robot(card(learned()), "exo-01", units())
    check_robot(card(learned(), robot="exo-01"), "exo-01", units())


def test_a_robot_that_lacks_a_channel_is_refused_by_its_name() -> None:
    known = units()
    gone = card(learned()).channels[0]
    del known[gone]
    with pytest.raises(UnusableModel, match=f"needs {re.escape(gone)}, which exo-01 does not have"):
        check_robot(card(learned()), "exo-01", known)


def test_a_robot_with_another_unit_is_refused_with_both_units() -> None:
    channel = card(learned()).channels[2]
    with pytest.raises(
        UnusableModel, match=f"learned {re.escape(channel)} in m/s², and exo-01 gives it in g:"
    ):
        check_robot(card(learned()), "exo-01", units({channel: "g"}))


def test_a_robot_that_a_model_was_not_adapted_to_is_refused() -> None:
    with pytest.raises(UnusableModel, match="adapted to exo-01, and is not for exo-02"):
        check_robot(card(learned(), robot="exo-01"), "exo-02", units())


# --- the hash of the features' code

CODE = '''"""Module."""
def compute(windows):
    """What it does."""
    return (windows * {factor}).sum()
'''


@pytest.fixture
def hashed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """The hash of a recipe whose code is this text."""
    monkeypatch.syspath_prepend(tmp_path)

    def of(text: str, **changes: Any) -> str:
        (tmp_path / "our_recipe.py").write_text(text)
        linecache.clearcache()
        code._digest.cache_clear()
        import our_recipe  # type: ignore[import-not-found]

        recipe = Recipe("ours", 50.0, 10, ("a", "b"), partial(our_recipe.compute))
        return features_hash(dataclasses.replace(recipe, **changes))

    return of


def test_other_code_or_other_numbers_have_another_hash(hashed: Callable[..., str]) -> None:
    text = CODE.format(factor=2.0)
    hashes = {
        hashed(text),
        hashed(CODE.format(factor=2.5)),
        hashed(text, look_back=11),
        hashed(text, rate_hz=100.0),
        hashed(text, channels=("b", "a")),
    }
    assert len(hashes) == 5


def test_comments_docstrings_and_layout_do_not_count(hashed: Callable[..., str]) -> None:
    text = CODE.format(factor=2.0)
    other = (
        text.replace("Module.", "Recipe.")
        .replace("What it does.", "Sums.")
        .replace("(windows)", "( windows )")
    )
    assert hashed(text) == hashed("# comment\n\n" + other)


def test_modules_that_a_recipe_imports_count(monkeypatch: pytest.MonkeyPatch) -> None:
    before = features_hash(GAIT_STATUS)
    digest = code._digest
    monkeypatch.setattr(
        code, "_digest", lambda name: b"other" if name == "ml.features.signals" else digest(name)
    )
    assert features_hash(GAIT_STATUS) != before


# --- how it was judged


def test_figures_are_those_of_scikit_learn() -> None:
    random = np.random.default_rng(0)
    classes = ("sit", "stand", "walk")
    truth = random.integers(0, 3, 400)
    probabilities = random.dirichlet((1, 1, 1), 400) + np.eye(3)[truth]
    probabilities /= probabilities.sum(axis=1, keepdims=True)
    label = probabilities.argmax(axis=1)
    subject = np.array(["one", "two"])[random.integers(0, 2, 400)]
    found = judged(classes, truth, probabilities, label, list(subject))
    expected = precision_recall_fscore_support(truth, label)
    for at, name in enumerate(classes):
        score = found.per_class[name]
        got = (score.precision, score.recall, score.f1, score.support)
        assert got == pytest.approx([figure[at] for figure in expected])
    assert found.figures["macro_f1"] == pytest.approx(f1_score(truth, label, average="macro"))
    assert np.array(found.confusion)[:, :3].tolist() == confusion_matrix(truth, label).tolist()
    one = subject == "one"
    assert found.per_subject["one"] == pytest.approx(f1_score(truth[one], label[one], average="macro"))
    assert sum(each.count for each in found.calibration) == 400


def test_an_abstention_is_no_right_answer_and_has_a_column_of_its_own() -> None:
    truth = np.array([0, 0, 1, 1])
    found = judged(("a", "b"), truth, np.full((4, 2), 0.5), np.array([0, -1, 1, -1]), ["x"] * 4)
    assert found.confusion == ((1, 0, 1), (0, 1, 1))
    assert found.figures == {"macro_f1": pytest.approx(2 / 3), "accuracy": 0.5, "abstained": 0.5}


def test_calibration_compares_what_was_said_with_what_was_right() -> None:
    probabilities = np.array([[0.95, 0.05]] * 4 + [[0.35, 0.65]] * 2)
    truth = np.array([0, 0, 0, 1, 1, 0])
    found = judged(("a", "b"), truth, probabilities, probabilities.argmax(axis=1), ["x"] * 6)
    said = [(round(each.said, 2), each.right, each.count) for each in found.calibration]
    assert said == [(0.65, 0.5, 2), (0.95, 0.75, 4)]
    assert found.calibration_error == pytest.approx((0.15 * 2 + 0.2 * 4) / 6)
