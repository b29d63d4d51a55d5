"""Models: quick trees, phases without wrong labels, a wearer's own walk, alarms and their threshold."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.neural_network import MLPClassifier
from threadpoolctl import threadpool_limits

from ml.benchmarks.models.falling import FAR, FallDetector, FallSettings, trailing_mean
from ml.benchmarks.models.gait_phase import PhaseModel, PhaseSettings
from ml.benchmarks.models.gait_status import status_model
from ml.benchmarks.models.quick import QuickTerrain, probabilities, scaled_rows
from ml.benchmarks.models.terrain import TerrainSettings, terrain_model
from ml.benchmarks.models.trees import QuickTrees
from ml.errors import UnusableData
from ml.neural import fixed_epochs, scaled

Floats = npt.NDArray[np.float32]
SMALL = PhaseSettings(hidden=(16, 8), networks=1, first_epochs=15, epochs=15, personal_epochs=40)


@pytest.fixture(autouse=True)
def on_one_core() -> Iterator[None]:
    with fixed_epochs(), threadpool_limits(limits=1):
        yield


@pytest.mark.parametrize("classes", [2, 4])
def test_quick_trees_say_what_scikit_learns_trees_say(classes: int) -> None:
    random = np.random.default_rng(0)
    x = random.normal(size=(400, 6)).astype(np.float32)
    truth = np.digitize(x[:, 0] + x[:, 1] * x[:, 2], np.linspace(-1, 1, classes - 1))
    model = HistGradientBoostingClassifier(max_iter=12, early_stopping=False).fit(x, truth)
    other = HistGradientBoostingClassifier(max_iter=5, max_depth=2, early_stopping=False).fit(x, truth)
    quick = QuickTrees([model, other])
    for rows in (x, x[:1]):
        for said, plain in zip(quick.predict_proba(rows), (model, other), strict=True):
            assert np.allclose(said, plain.predict_proba(rows), atol=1e-12)


@pytest.mark.parametrize("classes", [2, 3])
def test_a_quick_network_says_what_scikit_learns_network_says_bit_for_bit(classes: int) -> None:
    random = np.random.default_rng(0)
    x = (3.0 * random.normal(size=(300, 7)) + 100.0).astype(np.float32)
    truth = np.digitize(x[:, 0], np.linspace(99, 101, classes - 1))
    network = scaled(MLPClassifier((12,), max_iter=5, random_state=0)).fit(x, truth)
    for rows in (x, x[:1]):
        said = probabilities(network[-1], scaled_rows(network, rows))
        assert np.array_equal(said, network.predict_proba(rows))


def test_a_quick_support_vector_machine_says_what_scikit_learns_says() -> None:
    random = np.random.default_rng(1)
    x = random.normal(size=(300, 6)).astype(np.float32)
    truth = np.digitize(x[:, 0] + 0.5 * x[:, 1], [-1.0, 0.0, 1.0])
    model = terrain_model().fit(x[:200], truth[:200])
    quick = QuickTerrain(model, TerrainSettings().sharpness)
    assert np.array_equal(quick.predict(x), model.predict(x))
    assert np.array_equal(quick.predict(x[:1]), model.predict(x[:1]))


def test_status_is_learned_and_repeats_itself() -> None:
    random = np.random.default_rng(0)
    truth = random.integers(0, 3, 1200)
    x = (random.normal(size=(1200, 5)) + truth[:, None] * [2, 0, 0, 0, -1]).astype(np.float32)
    first, second = (status_model().fit(x[:800], truth[:800]).predict_proba(x[800:]) for _ in range(2))
    assert (first.argmax(axis=1) == truth[800:]).mean() > 0.8
    assert np.array_equal(first, second)


def strides(count: int, shift: float = 0.0) -> tuple[Floats, npt.NDArray[np.float64], npt.NDArray[np.int_]]:
    """Features that point round the cycle, `shift` of it ahead."""
    phase = np.tile(np.arange(0, 1, 0.1), count)
    angle = 2 * np.pi * (phase + shift)
    random = np.random.default_rng(count)
    x = np.stack([np.cos(angle), np.sin(angle), np.cos(2 * angle)], axis=1)
    return (x + random.normal(0, 0.02, x.shape)).astype(np.float32), phase, np.repeat(np.arange(count), 10)


def error(model: PhaseModel, x: Floats, phase: npt.NDArray[np.float64]) -> float:
    return float(np.abs((model.predict(x) - phase + 0.5) % 1.0 - 0.5).mean())


def test_strides_with_wrong_labels_are_left_out() -> None:
    x, phase, stride = strides(200)
    wrong = stride < 20
    labelled = np.where(wrong, (phase + 0.4) % 1.0, phase)
    model = PhaseModel(SMALL).fit(x, labelled, stride)
    assert not model.kept_[wrong].any()
    assert model.kept_[~wrong].all()
    assert error(model, x, phase) < 0.03


def test_a_wearers_own_walk_is_learned_and_the_general_model_stays() -> None:
    x, phase, stride = strides(200)
    model = PhaseModel(SMALL).fit(x, phase, stride)
    own_x, own_phase, own_stride = strides(30, shift=0.08)
    before = error(model, own_x, own_phase)
    personal = model.personal(own_x, own_phase, own_stride)
    assert before == pytest.approx(0.08, abs=0.03)
    assert error(personal, own_x, own_phase) < 0.6 * before
    assert error(model, own_x, own_phase) == before


def test_networks_go_only_so_far_from_the_general_ones_as_they_are_trusted() -> None:
    x, phase, stride = strides(60)
    own = strides(30, shift=0.08)
    changes = []
    for trust in (0.0, 0.5, 1.0):
        model = PhaseModel(replace(SMALL, trust=trust)).fit(x, phase, stride)
        general, personal = model.networks_[0].coefs_[0], model.personal(*own).networks_[0].coefs_[0]
        changes.append(personal - general)
    assert np.allclose(changes[0], 0.0, atol=1e-6)
    assert np.allclose(changes[1], 0.5 * changes[2], atol=1e-6)
    assert np.abs(changes[2]).max() > 0.01


def test_the_mean_of_decisions_ends_at_a_recordings_beginning() -> None:
    values, recording = np.array([1.0, 0.0, 1.0, 1.0, 1.0]), np.array([0, 0, 0, 1, 1])
    assert trailing_mean(values, recording, 2).tolist() == [0.5, 0.5, 0.5, 0.5, 1.0]
    assert trailing_mean(values, recording, 1).tolist() == values.tolist()


def test_the_threshold_keeps_false_alarms_of_people_not_learned_from_as_few_as_asked() -> None:
    random = np.random.default_rng(0)
    recording = np.repeat(np.arange(120), 40)
    fall = (recording % 2 == 0)[:, None]
    at = np.tile(np.arange(40), 120)
    to_impact = np.where(fall[:, 0], 39 - at, FAR)
    x = random.normal(0, 1, (len(recording), 118)).astype(np.float32)
    x[:, 0] += np.where(to_impact < 20, 2.0, 0.0)
    settings = FallSettings(unclear=25, still_share=1.0, moving_share=1.0, rounds=10, false_alarms=0.2)
    model = FallDetector(settings).fit(x, to_impact, recording, recording // 10)
    alarmed = set(recording[model.alarms(x, recording)])
    daily = [one for one in range(120) if one % 2]
    assert len(alarmed & set(daily)) / len(daily) <= 0.2
    assert len(alarmed - set(daily)) / 60 > 0.9


def test_falls_of_one_person_alone_are_too_few() -> None:
    recording = np.repeat(np.arange(4), 30)
    to_impact = np.where(recording == 0, 29 - np.tile(np.arange(30), 4), FAR)
    x = np.zeros((len(recording), 118), dtype=np.float32)
    with pytest.raises(UnusableData, match="too few people fall"):
        FallDetector(FallSettings(still_share=1.0)).fit(x, to_impact, recording, recording)
