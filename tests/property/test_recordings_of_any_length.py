"""A benchmark reads recordings of any length, with events anywhere: it judges them or says why it cannot."""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ml.benchmarks import events, fall, ipol, status, strides
from ml.benchmarks.sisfall import Recording
from ml.errors import UnusableData
from tests.support.examples import examples

ROWS = st.integers(min_value=1, max_value=420)
FEET = st.lists(st.integers(min_value=1, max_value=130), min_size=1, max_size=12)


def alternating(lengths: Sequence[int], rows: int) -> npt.NDArray[np.bool_]:
    """On the ground and in the air in turn, for so many samples each."""
    flags = np.concatenate([np.full(length, bool(at % 2)) for at, length in enumerate(lengths)])
    return np.resize(flags, rows)


@st.composite
def trials(draw: st.DrawFn) -> list[ipol.Trial]:
    """Two people's walks; feet turn as the labels say, or nearly so."""
    return [made(subject, draw(ROWS), draw(FEET), draw(st.integers(-8, 8))) for subject in (1, 2, 2)]


def made(subject: int, rows: int, lengths: Sequence[int], ahead: int) -> ipol.Trial:
    in_air = alternating(lengths, rows)
    samples = np.zeros((rows, 18))
    samples[:, 0] = 9.81
    for _, pitch in strides.FEET:
        samples[:, pitch] = np.where(np.roll(in_air, ahead), 3.0, -1.0)
    states = np.resize(np.repeat(np.arange(3), 40), rows)
    return ipol.Trial(subject, rows, samples, states, (in_air, ~in_air))


def judged_or_refused(make: Callable[[], object]) -> bool:
    try:
        make()
    except UnusableData:
        return False
    return True


@settings(max_examples=examples(40))
@given(trials())
def test_walks_of_any_length_are_cut_into_strides(walks: list[ipol.Trial]) -> None:
    if judged_or_refused(lambda: strides.lessons(walks)):
        data = strides.decisions(walks)
        assert ((data.phase >= 0) & (data.phase < 1)).all()
        assert np.isfinite(data.features).all()


@settings(max_examples=examples(40))
@given(trials())
def test_walks_of_any_length_are_decided_upon(walks: list[ipol.Trial]) -> None:
    data = status.decisions(walks)
    assert len(data.truth) == sum(len(range(status.FIRST, len(one.samples), status.STEP)) for one in walks)


@settings(max_examples=examples(40))
@given(trials())
def test_feet_of_walks_of_any_length_have_their_moments_also_with_packets_lost(
    walks: list[ipol.Trial],
) -> None:
    for some in (walks, ipol.lossy(walks, 0.2)):
        feet = events.feet_of(some)
        assert len(feet) == 2 * len(walks)
        for foot in feet:
            assert len(foot.features) == len(foot.at) == len(foot.apart())
            assert np.isfinite(foot.features).all()
            assert all(seen <= len(true) for seen, true in zip(foot.seen, foot.true, strict=True))


@settings(max_examples=examples(40))
@given(ROWS, st.integers(min_value=0, max_value=419))
def test_falls_at_any_moment_of_recordings_of_any_length(rows: int, impact: int) -> None:
    samples = np.full((rows, 6), 4.0)
    fallen = Recording("a", "F01", samples, min(impact, rows - 1))
    data = fall.decisions([fallen, Recording("b", "D01", samples, None)])
    assert set(data.recording.tolist()) == {0, 1}
    assert np.isfinite(data.features).all()


def test_a_walk_of_one_sample_leaves_nothing_to_the_faster() -> None:
    walks = [made(subject, rows, [60, 40] * 4, 0) for subject, rows in ((1, 420), (2, 420), (2, 1))]
    assert judged_or_refused(lambda: strides.lessons(walks))


@pytest.mark.parametrize("late", range(1, 6))
def test_a_strike_just_before_the_end_is_none_beyond_it(late: int) -> None:
    """`ipol-phase` once ended with a shape error there."""
    swing = [60, 40] * 4
    whole = sum(swing) + late
    walk = made(1, whole, swing, 0)
    data = strides.decisions([walk, made(2, whole, swing, 0)])
    assert len(data.phase)
