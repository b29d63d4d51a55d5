"""`ipol-danger`, `sisfall-danger`: recorded people as the watch sees them, and what counts as foreseen."""

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from ml.benchmarks import BENCHMARKS, ipol_danger, sisfall_danger
from ml.benchmarks.danger import PERIOD_S, Judged, events
from ml.benchmarks.danger_data import HEALTHY, LEARNED_S, Seen
from ml.benchmarks.danger_trunk import OWN, PAUSE_S, Person, channels, figures, upright
from ml.benchmarks.report import page
from ml.benchmarks.sisfall_danger import FALL_S, LEAD_IN, Watched, fallen, outcome
from ml.danger.calibration import load
from ml.danger.detector import DETECTORS
from ml.danger.levels import Level
from ml.danger.observation import CHANNELS
from tests.unit.ml.recordings import falls, gait, saved

G = 9.81


def leaning(forward: float, left: float) -> npt.NDArray[np.float64]:
    """What an accelerometer in the trunk's axes says of somebody who leans, rad."""
    return G * np.array(
        [-math.sin(forward), -math.sin(left), math.sqrt(1 - math.sin(forward) ** 2 - math.sin(left) ** 2)]
    )


def said(level: list[Level], label: str = "D07", subject: str = "S1") -> Judged:
    """One recording, known for long enough, a level each moment."""
    count = len(level)
    at_s = LEARNED_S + 1.0 + PERIOD_S * np.arange(count, dtype=np.float64)
    above = np.full((count, len(DETECTORS)), np.nan)
    above[:, 4] = 0.0
    seen = Seen(subject, (), at_s, above, np.full(count, HEALTHY), np.full(count, label))
    return Judged(seen, np.zeros(count), np.array(level, dtype=np.int_))


@pytest.mark.parametrize("axes", [ipol_danger.AXES, sisfall_danger.AXES])
def test_axes_are_right_handed(axes: tuple[tuple[int, ...], ...]) -> None:
    assert np.linalg.det(np.array(axes)) == pytest.approx(1.0)


def test_a_sensor_put_on_askew_is_counted_from_upright() -> None:
    axes = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    askew = np.tile(np.concatenate([leaning(0.3, -0.2), np.zeros(3)]), (20, 1))
    found = upright(askew, askew, axes)
    assert found[:, :3] == pytest.approx(np.tile([0.0, 0.0, G], (20, 1)), abs=1e-9)


def test_tilt_follows_gravity_and_the_rates_and_is_missing_where_a_packet_is() -> None:
    rate_hz, bends = 100, 0.5
    angle = np.linspace(0.0, bends, 100)
    trunk = np.zeros((100, 6))
    trunk[:, :3] = [leaning(one, 0.0) for one in angle]
    trunk[:, 4] = bends / 0.99
    trunk[50] = np.nan
    rows = channels(trunk, rate_hz)
    assert rows.shape == (100, len(CHANNELS))
    assert np.isnan(rows[50]).all()
    assert np.isnan(np.delete(rows, OWN, axis=1)).all()
    tilt = rows[:, OWN[6:]]
    assert tilt[-1] == pytest.approx([bends, 0.0], abs=0.01)
    trunk[:, 4] = 0.0  # a rate that contradicts gravity: half of it is believed after 1.4 s
    assert channels(trunk, rate_hz)[-1, OWN[6]] < 0.3
    sideways = np.tile(np.concatenate([leaning(0.0, 0.4), np.zeros(3)]), (3, 1))
    assert channels(sideways, rate_hz)[:, OWN[7]] == pytest.approx(np.full(3, 0.4))


def test_a_persons_recordings_follow_one_another_and_nobody_learns_from_a_copy() -> None:
    person, rows = Person.of("1", load()), np.full((9, len(CHANNELS)), np.nan)
    first = person.take(rows, 50.0, np.full(9, "D01"))
    assert first.seen.at_s.tolist() == pytest.approx([PAUSE_S + one for one in (0.0, 0.04, 0.08, 0.12, 0.16)])
    person.again().take(rows, 50.0, np.full(9, "F01"))
    second = person.take(rows, 50.0, np.full(9, "D02"))
    assert second.seen.at_s[0] == pytest.approx(2 * PAUSE_S + 9 / 50.0)
    assert (second.level == Level.UNKNOWN).all()
    every = figures([first, second], [np.ones(5, dtype=np.bool_)] * 2)
    assert (every["share_judged"], every["share_said_to_be_fine"], every["advice_per_hour"]) == (
        0.0,
        0.0,
        0.0,
    )


@pytest.mark.parametrize(
    ("begins", "ends", "foreseen", "told"),
    [(70, 80, True, True), (95, 100, False, True), (100, 100, False, False), (55, 90, False, False)],
)
def test_advice_of_a_fall_has_to_begin_in_it(begins: int, ends: int, *, foreseen: bool, told: bool) -> None:
    level = [Level.ADVICE if begins <= at < ends else Level.UNKNOWN for at in range(100)]
    judged = said(level, "F01")
    (event,) = events(fallen(judged, float(judged.seen.at_s[-1])), Level.ADVICE)
    assert 100 - FALL_S / PERIOD_S < 70
    assert (event.foreseen, event.lead_s is not None) == (foreseen, told)


def test_figures_by_hand() -> None:
    calm, advice = [Level.UNKNOWN] * 100, [Level.UNKNOWN] * 70 + [Level.ADVICE] * 30
    falls_said = [said(one, "F01", subject) for one, subject in ((calm, "S1"), (advice, "S2"))]
    found = [Watched("F01", fallen(one, float(one.seen.at_s[-1]))) for one in falls_said]
    found += [Watched("D07", said(one)) for one in (calm, calm, advice, calm)]
    found.append(Watched("D07", said(advice, LEAD_IN)))
    made = outcome(found)
    assert made.subjects == 2
    assert made.figures["falls"] == 2.0
    assert made.figures["foreseen"] == 0.5
    assert made.figures["already_said"] == 0.0
    assert made.figures["daily_recordings_with_advice"] == 0.2
    assert made.figures["advice_per_hour"] == pytest.approx(3600 / (400 * PERIOD_S))
    assert (made.by_group["F01"]["told"], made.by_group["D07"]["told"]) == (0.5, 0.2)
    assert "F01" in page(BENCHMARKS["sisfall-danger"], made, "falls.npz")


def test_short_recordings_of_people_whom_nobody_knows_yet(tmp_path: Path) -> None:
    arrays = gait(2, 1, 1.0)
    rows = np.concatenate([np.flatnonzero(arrays["subject"] == one)[:40] for one in (0, 1)])
    for name in ("x", "status", "left_event", "right_event", "subject", "trial"):
        arrays[name] = arrays[name][rows]
    made = BENCHMARKS["ipol-danger"].run(saved(tmp_path / "gait.npz", arrays), False)
    assert made.subjects == 2
    assert math.isnan(made.figures["advice_per_hour"])
    assert math.isnan(made.figures["with_feet_share_judged"])
    arrays = falls(3, 1)
    arrays["rec_len"] = np.minimum(arrays["rec_len"], 40)
    arrays["rec_peak_acc_index"] = np.minimum(arrays["rec_peak_acc_index"], [39, 1, 1] * 3)
    made = BENCHMARKS["sisfall-danger"].run(saved(tmp_path / "falls.npz", arrays), False)
    assert made.subjects == 3
    assert (made.figures["falls"], made.figures["foreseen"]) == (3.0, 0.0)
