"""How right predictions were of late: counted where labels say what was so; only what has changed is read."""

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from ml.registry.registry import SHIPPED, Registry
from ml.robot.learned import Learned
from ml.store.labels import LabelSource
from server_gui.core.prediction.state import Quality
from server_gui.core.prediction.track_record import Stretch, TrackRecord
from tests.unit.prediction.lab import SESSION, Lab
from tests.unit.prediction.robots import ROBOT, publish

NOW = datetime(2026, 11, 21, 15, 30, tzinfo=UTC)
DELAY_MS = 200  # what activity says is about so long ago


def phase_model() -> Learned:
    """Of what comes with GWRMS."""
    registry = Registry(SHIPPED.as_uri())
    (card,) = registry.entries("gait_phase")
    return Learned.restored(registry.load(card.id)[1])


@pytest.fixture
def lab(folder_url: str) -> Lab:
    return Lab(folder_url, round((NOW - timedelta(hours=1)).timestamp()) * 10**9)


def figures(lab: Lab, now: datetime = NOW) -> dict[str, Quality]:
    """Of the robot's activity, by model."""
    return TrackRecord(lab.url).figures({ROBOT}, now).get(ROBOT, {}).get("activity", {})


def test_what_is_labelled_is_right_wrong_or_not_said(lab: Lab) -> None:
    lab.say(["walk"] * 8 + ["stand"] + ["unknown"] * 2 + ["abnormal"] + ["stand"] * 10)
    lab.label("walk", -DELAY_MS, 1_200 - DELAY_MS)  # what the first twelve are about
    assert figures(lab) == {
        lab.model: Quality(12, 8, 1, 3, {"walk": {"abnormal": 1, "stand": 1, "unknown": 2, "walk": 8}}, 2, 1)
    }


def test_nothing_is_claimed_where_nobody_has_labelled_anything(lab: Lab) -> None:
    assert figures(lab) == {}
    lab.say(["walk"] * 5)
    assert figures(lab) == {}
    lab.label("wearer Ada", 0, 500)
    lab.label("sit", 0, 500)  # no class of this model
    lab.label("walk", 0, 500, source=LabelSource.PSEUDO)
    lab.label("walk", 0, 500, robot="exo-02")
    assert figures(lab) == {}


def test_models_and_sessions_are_counted_by_themselves(lab: Lab) -> None:
    other = publish(lab.url, notes="another", learned=("20261121T1200",))
    for session in (SESSION, "20261121T1200"):
        for model in (lab.model, other, "activity-gone"):
            lab.say(["walk"] * 5, session=session, model=model)
        lab.label("walk", -DELAY_MS, 500, session=session)
    lab.say(["steady"] * 5, task="falling")
    found = figures(lab)
    assert {
        model: (one.labelled, one.right, one.seconds, one.recordings) for model, one in found.items()
    } == {
        lab.model: (10, 10, 2, 2),
        other: (5, 5, 1, 1),  # it has learned from the other session
    }


def test_only_the_last_days_count(lab: Lab) -> None:
    lab.say(["walk"] * 5)
    lab.label("walk", -DELAY_MS, 500)
    assert figures(lab, NOW + timedelta(days=6, hours=22))
    assert not figures(lab, NOW + timedelta(days=7, hours=1))


def test_only_what_has_changed_is_read_again(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    compared = TrackRecord._compared

    def counted(self: TrackRecord, stretch: Stretch, version: int) -> Any:
        read.append(stretch.labels[0].session)
        return compared(self, stretch, version)

    monkeypatch.setattr(TrackRecord, "_compared", counted)
    record = TrackRecord(lab.url)

    def right() -> int:
        """Of both sessions; what was read for that is in `read`."""
        read.clear()
        return sum(one.right for one in record.figures({ROBOT}, NOW)[ROBOT]["activity"].values())

    later_ms = 600_000
    for session, begin_ms in (("a", 0), ("b", later_ms)):
        lab.say(["walk"] * 5, begin_ms, session=session)
        lab.label("walk", begin_ms - DELAY_MS, begin_ms + 300 - DELAY_MS, session=session)
    assert (right(), sorted(read)) == (6, ["a", "b"])
    assert (right(), read) == (6, [])
    lab.say(["walk"] * 5, begin_ms=60_000, session="a")  # nobody has labelled that
    assert (right(), read) == (6, [])
    more = later_ms + 300 - DELAY_MS, later_ms + 400 - DELAY_MS
    lab.label("walk", *more, session="b")
    assert (right(), read) == (7, ["b"])
    lab.label("walk", *more, session="b", removed=True)
    assert (right(), read) == (6, ["b"])
    lab.say(["walk"], begin_ms=100, session="a", model=publish(lab.url, notes="late"))
    assert (right(), read) == (7, ["a"])


def test_where_it_is_to_end_it_reads_nothing_more(lab: Lab) -> None:
    lab.say(["walk"] * 5)
    lab.label("walk", -DELAY_MS, 500)
    record = TrackRecord(lab.url)
    assert record.figures({ROBOT}, NOW, lambda: True) == {}
    assert record.figures({ROBOT}, NOW) != {}


def test_a_phase_is_right_within_a_tenth_of_the_cycle_of_both_legs(lab: Lab) -> None:
    model = publish(lab.url, phase_model())
    for at_ms in range(0, 4_001, 1_000):  # strides of a second, the legs half of one apart
        lab.label("left_heel_strike", at_ms, at_ms)
        lab.label("right_heel_strike", at_ms + 500, at_ms + 500)
    lab.label("stand", 10_000, 12_000)
    of_phase: dict[str, Any] = {"task": "gait_phase", "model": model}

    def say(label: str, begin_ms: int, count: int, ahead: float) -> None:
        for at_ms in range(begin_ms, begin_ms + 100 * count, 100):
            left = (at_ms / 1000 + ahead) % 1.0
            values = f'{{"left": {left}, "right": {(left + 0.5) % 1.0}}}'
            lab.say([label], at_ms, values=values, **of_phase)

    say("stride", 600, 4, ahead=0.09)
    say("stride", 1_600, 3, ahead=-0.11)
    say("unknown", 2_600, 2, ahead=0.5)
    say("stride", 10_100, 1, ahead=0.0)
    say("unknown", 10_200, 3, ahead=0.0)  # as it should be
    say("stride", 6_000, 3, ahead=0.0)  # nobody knows
    found = TrackRecord(lab.url).figures({ROBOT}, NOW)[ROBOT]["gait_phase"]
    confusion = {"no stride": {"stride": 1}, "stride": {"another phase": 3, "stride": 4, "unknown": 2}}
    assert found == {model: Quality(10, 4, 4, 2, confusion, 4, 1)}
