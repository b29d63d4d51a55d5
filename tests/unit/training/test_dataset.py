"""A session's decisions: what is known of them, who said so, and why there are none."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace as changed

from ml.features.recipe import features
from ml.robot.task import recipe_named
from ml.serving.grid import on_grid
from ml.store import Store
from ml.store.labels import REGRESSION, Label, LabelSource
from ml.training.dataset import Ask, LeftOut, SessionDecisions, part, versions
from server_gui.core.recording import records
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from tests.unit.training.walkers import BEGAN_UTC, CHANNELS, HZ, Made, S, day, put, stamps_ns

RECIPE = "activity/hips+knees"


@pytest.fixture
def spool(tmp_path: Path) -> Path:
    return tmp_path / "spool"


def asked(url: str, spool: Path, made: Made, recipe: str = RECIPE) -> SessionDecisions | LeftOut:
    store = put(url, spool, [made])
    return part(Ask(url, versions(store, [made.robot]), made.robot, made.session, recipe))


def had(url: str, spool: Path, made: Made, recipe: str = RECIPE) -> SessionDecisions:
    found = asked(url, spool, made, recipe)
    assert isinstance(found, SessionDecisions)
    return found


def why(url: str, spool: Path, made: Made) -> str:
    found = asked(url, spool, made)
    assert isinstance(found, LeftOut)
    return found.why


def test_decisions_have_the_features_that_there_would_be_live_and_the_label_of_their_moment(
    folder_url: str, spool: Path
) -> None:
    made = day("s", 1)
    found = had(folder_url, spool, made)
    recipe = recipe_named(RECIPE)
    ((grid_ns, samples),) = on_grid(recipe, stamps_ns(len(made.values)), made.values)
    ends = np.searchsorted(grid_ns, found.stamps_ns)
    assert (grid_ns[ends] == found.stamps_ns).all()
    assert (features(recipe, samples, ends) == found.features).all()
    assert (found.stamps_ns % (100 * 10**6) == 0).all()
    about_ns = found.stamps_ns - stamps_ns(1)[0] - 200 * 10**6
    assert found.truth.tolist() == [("stand", "walk", "sit")[at // (8 * S)] for at in about_ns.tolist()]
    assert set(found.source) == {"person"}
    assert (found.group, found.regression) == ("s", False)
    assert not found.named
    assert found.ranges.shape == (len(CHANNELS), 2)


def test_phases_are_known_where_legs_step_and_where_they_stand(folder_url: str, spool: Path) -> None:
    found = had(folder_url, spool, day("s", 1, strikes=True), "gait_phase/hips+knees")
    steps = ~np.isnan(found.truth).any(axis=1)
    assert 0.2 < steps.mean() < 0.4  # a third of the time
    lag = (found.truth[steps, 0] - found.truth[steps, 1]) % 1.0
    np.testing.assert_allclose(lag, 0.5, atol=0.01)


def test_who_wore_the_robot_and_the_regression_set_are_labels_too(folder_url: str, spool: Path) -> None:
    made = day("s", 1, wearer="P03")
    found = had(
        folder_url, spool, replace(made, said=[*made.said, (0.0, 24.0, REGRESSION, LabelSource.PERSON)])
    )
    assert (found.group, found.regression) == ("p3", True)
    assert found.named


def test_a_wearer_is_one_however_he_is_spelled(folder_url: str, spool: Path) -> None:
    made = day("s", 1, wearer="P-03")
    found = had(
        folder_url, spool, replace(made, said=[*made.said, (0.0, 1.0, "wearer p03 ", LabelSource.PERSON)])
    )
    assert (found.group, found.named) == ("p3", True)


def test_two_wearers_at_once_are_refused(folder_url: str, spool: Path) -> None:
    made = day("s", 1, wearer="P03")
    told = replace(made, said=[*made.said, (0.0, 1.0, "wearer P04", LabelSource.PERSON)])
    assert why(folder_url, spool, told) == "it has labels of several wearers: P03, P04; take all but one back"


def test_what_cannot_be_learned_from_is_left_out_with_a_sentence(folder_url: str, tmp_path: Path) -> None:
    long = day("s", 1)
    holes = long.values.copy()
    holes[::HZ, 2] = np.nan
    holes[50::HZ] = np.nan
    silent = long.values.copy()
    silent[:, 3] = np.nan
    gappy = long.values.copy()
    gappy[(np.arange(len(gappy)) % 150) < 30, 1] = np.nan
    degrees = {name: "deg" if name == "left_knee.position" else "rad" for name in CHANNELS}
    cases = {
        "it lasts 1.5 s: activity/hips+knees looks back 2 s": replace(long, values=long.values[:150]),
        "nobody has said what robot or wearer did in it (gwrms label)": replace(long, said=[]),
        "it has no value of right_knee.position, which activity/hips+knees needs": replace(
            long, values=silent
        ),
        "no 2 s of it are without a gap: right_hip.position is missing in 20 % of the rows": replace(
            long, values=gappy
        ),
        "left_knee.position is in deg; models learn from rad": Made(
            "s", long.values, long.said, units=degrees
        ),
        f"it has no value of {CHANNELS[2]}, {CHANNELS[3]}, which activity/hips+knees needs": replace(
            long, values=long.values[:, :2], channels=CHANNELS[:2]
        ),
    }
    for number, (words, made) in enumerate(cases.items()):
        assert why(f"{folder_url}{number}", tmp_path / f"spool{number}", made) == words
    # Values that are missing for less than 100 ms are as live: the newest one holds.
    assert isinstance(
        asked(f"{folder_url}x", tmp_path / "spoolx", replace(long, values=holes)), SessionDecisions
    )


def test_an_old_version_of_the_tables_says_what_it_said(folder_url: str, spool: Path) -> None:
    made = day("s", 1)
    store = put(folder_url, spool, [made])
    ask = Ask(folder_url, versions(store, ["exo"]), "exo", "s", RECIPE)
    before = part(ask)
    relabel(store, spool, Label("exo", "s", BEGAN_UTC + 9 * S, BEGAN_UTC + 15 * S, "turn_left", "bob"))
    again, now = part(ask), part(changed(ask, versions=versions(store, ["exo"])))
    assert isinstance(before, SessionDecisions)
    assert isinstance(again, SessionDecisions)
    assert isinstance(now, SessionDecisions)
    assert (again.features == before.features).all()
    assert again.truth.tolist() == before.truth.tolist()
    assert len(now.truth) < len(before.truth)  # two people differ, so nobody knows


def relabel(store: Store, spool: Path, label: Label) -> None:
    with Spool(spool, reserve_bytes=0) as opened:
        opened.append((), [records.label(label)])
        opened.freeze()
        for batch in opened.waiting():
            send(opened, batch, store)


def test_a_wearer_who_was_named_when_it_was_recorded_is_known_without_a_label(
    folder_url: str, spool: Path
) -> None:
    named = replace(day("s", 1), recorded_wearer="p 03")
    assert had(folder_url, spool, named).group == "p3"


def test_a_label_and_a_recording_that_name_two_wearers_are_refused(folder_url: str, spool: Path) -> None:
    named = replace(day("s", 1, wearer="P04"), recorded_wearer="P03")
    assert (
        why(folder_url, spool, named) == "it has labels of several wearers: P03, P04; take all but one back"
    )
