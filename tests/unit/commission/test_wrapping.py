"""An encoder whose 32 bits wrap around while a joint is moved by hand is unwrapped in counts, and told."""

import math
from pathlib import Path

import pytest

from gateway.commission import joints
from gateway.commission.axes import HALF, Axis, nearest
from gateway.commission.dialogue import run
from gateway.commission.draft import Draft
from tests.unit.commission.fake_bench import FakeBench, FakeDrive, Hands
from tests.unit.commission.test_mishaps import doing

KNEE, HIP = Axis(7), Axis(11)
LAST = HALF - 1  # before it wraps


@pytest.fixture
def draft(tmp_path: Path) -> Draft:
    return Draft(tmp_path / "exo-01.toml")


@pytest.fixture
def bench() -> FakeBench:
    return FakeBench(node_7=FakeDrive(counts=LAST - 1_000), node_11=FakeDrive())


@pytest.mark.parametrize(
    ("counts", "to", "meant"), [(5, 0, 5), (-HALF, LAST, HALF), (LAST, -HALF, -HALF - 1)]
)
def test_the_nearest_of_what_it_can_mean(counts: int, to: int, meant: int) -> None:
    assert nearest(counts, to) == meant


def test_a_drive_that_wraps_while_it_is_bent_has_not_counted_four_milliards(
    draft: Draft, bench: FakeBench
) -> None:
    hands = Hands(("Bend the left knee", doing(bench.drives[7], counts=-HALF + 9_000)))
    assert run(joints.which_drive(draft, bench, "left_knee", [KNEE, HIP]), hands) == KNEE
    assert hands.heard("it counted 10001, the others 0")


def test_two_angles_on_both_sides_of_it_give_the_scale_and_are_told(draft: Draft, bench: FakeBench) -> None:
    knee = bench.drives[7]
    hands = Hands(
        ("one known angle", doing(knee, "0")),
        ("another known angle", doing(knee, "45", counts=-HALF + 51_200 - 1_002)),
        ("How far within its ends", lambda: "0"),
        ("as straight as", doing(knee, counts=LAST - 1_000)),
        ("as bent as", doing(knee, counts=-HALF + 51_200 - 1_002)),
    )
    scale = run(joints.meaning(draft, bench, "left_knee", KNEE), hands)
    assert (scale.direction, scale.gear_ratio) == (1, 100)
    assert hands.heard("wraps around within the joint's way")
    run(joints.limits(draft, bench, "left_knee", KNEE, scale), hands)
    limits = [draft.value("guard.rule.left_knee_range", key) for key in ("min", "max")]
    assert limits == pytest.approx([0, math.pi / 4], abs=1e-3)


def test_a_zero_that_is_many_turns_away_is_told(draft: Draft, bench: FakeBench) -> None:
    knee = bench.drives[7]
    hands = Hands(
        ("one known angle", doing(knee, "0", counts=-3 * 409_600)),
        ("another known angle", doing(knee, "45", counts=-3 * 409_600 + 51_200)),
    )
    assert run(joints.meaning(draft, bench, "left_knee", KNEE), hands).zero_offset == pytest.approx(
        3 * math.tau
    )
    assert hands.heard("a zero that is 3 turns of the joint away")
