"""What changed from one session to another, and what moved: known, not recorded, never mixed up."""

import json
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from gateway.main import main
from ml.store.sessions import Session
from server_gui.core.cloud.configuration_changes import (
    NOT_RECORDED,
    NOT_THERE,
    ChangeKind,
    Changes,
    SessionConfiguration,
    changes,
)
from server_gui.core.cloud.metric_changes import DAYS, Walk, moved
from server_gui.core.evidence.comparison import Word
from server_gui.core.evidence.cycles import Cycle
from tests.unit.cloud.recordings import record
from tests.unit.evidence.synthetic import cycles

SETUP = {
    "component/left_knee": "joint",
    "zero/left_knee": 0.01,
    "calibration/trunk": "no file",
    "firmware/left_knee": "1.2",
    "EDS/left_knee": "drive.eds 0011",
    "limits/left_knee.gain": "0 … 10",
    "robot.toml/digest": "aa",
}
OLD = Session(
    "exo-01",
    "20261119T09",
    datetime(2026, 11, 19, tzinfo=UTC),
    operator="anna",
    parameters={"left_knee.gain": 2.0, "gait.step_length": 0.4},
    versions={"gateway": "0.1.0"},
    setup=SETUP,
)


def compared(after: Session, before: Session = OLD, wearers: str = "P01", models: str = "m1") -> Changes:
    told = SessionConfiguration(before, frozenset({"P01"}), {"activity": "m1"})
    return changes(
        told, SessionConfiguration(after, frozenset({wearers} - {""}), {"activity": models} if models else {})
    )


def test_alike_sessions_have_no_difference() -> None:
    found = compared(replace(OLD, session="20261121T14"))
    assert found.differences == ()
    assert found.same >= len(SETUP)


def test_what_differs_is_told_in_order_the_wearer_first() -> None:
    after = replace(
        OLD,
        parameters={"left_knee.gain": 3.0, "gait.step_length": 0.41},
        setup={
            **SETUP,
            "zero/left_knee": 0.02,
            "calibration/trunk": "t.toml 5e",
            "firmware/left_knee": "1.3",
        },
        versions={"gateway": "0.2.0"},
    )
    found = compared(after, wearers="P02", models="m2")
    assert [(one.kind, one.what, one.before, one.after) for one in found.differences] == [
        (ChangeKind.WEARER, "wearer", "P01", "P02"),
        (ChangeKind.PARAMETER, "left_knee.gain", "2", "3"),
        (ChangeKind.PARAMETER, "gait.step_length", "0.4", "0.41"),
        (ChangeKind.CALIBRATION, "left_knee zero offset (rad)", "0.01", "0.02"),
        (ChangeKind.CALIBRATION, "trunk calibration", "no file", "t.toml 5e"),
        (ChangeKind.FIRMWARE, "left_knee firmware", "1.2", "1.3"),
        (ChangeKind.MODEL, "model of activity", "m1", "m2"),
        (ChangeKind.SOFTWARE, "gateway", "0.1.0", "0.2.0"),
    ]


def test_an_older_session_that_tells_nothing_is_not_recorded_and_never_unchanged() -> None:
    found = compared(OLD, replace(OLD, setup={}, parameters={}, versions={}))
    assert found.differences == ()
    unknown = {one.kind: (one.before, one.after) for one in found.unrecorded}
    for kind in (
        ChangeKind.FIRMWARE,
        ChangeKind.EDS,
        ChangeKind.LIMITS,
        ChangeKind.FILE,
        ChangeKind.SOFTWARE,
    ):
        assert unknown[kind][0] == NOT_RECORDED, kind
    assert unknown[ChangeKind.PARAMETER] == (NOT_RECORDED, "recorded of 2")


def test_what_neither_tells_is_not_recorded_of_both() -> None:
    bare = Session("exo-01", "b")
    found = changes(SessionConfiguration(bare, frozenset(), {}), SessionConfiguration(bare, frozenset(), {}))
    assert {(one.before, one.after) for one in found.unrecorded} == {(NOT_RECORDED, NOT_RECORDED)}
    assert {ChangeKind.WEARER, ChangeKind.PARAMETER, ChangeKind.FIRMWARE, ChangeKind.MODEL} <= {
        one.kind for one in found.unrecorded
    }
    assert found.same == 1, "the robot's name"


def test_a_joint_that_is_new_is_no_gap_in_the_record() -> None:
    found = compared(replace(OLD, setup={**SETUP, "component/right_knee": "joint"}))
    assert [(one.kind, one.before, one.after) for one in found.differences] == [
        (ChangeKind.COMPONENT, NOT_THERE, "joint")
    ]


def test_a_device_that_did_not_answer_is_not_recorded() -> None:
    found = compared(OLD, replace(OLD, setup={k: v for k, v in SETUP.items() if "firmware" not in k}))
    unknown = [(one.before, one.after) for one in found.unrecorded if one.kind is ChangeKind.FIRMWARE]
    assert (NOT_RECORDED, "1.2") in unknown
    assert found.differences == ()


def walked(found: list[Cycle], *, knows: bool = False) -> Walk:
    return Walk(found, ("left_knee",), knows)


def test_what_moved_is_said_in_the_words_of_edits_though_the_robot_has_booted() -> None:
    """Each walk has a clock of its own, and both begin at 0."""

    def worse(_: float, values: dict[str, float]) -> None:
        values["left_knee.error_rms"] *= 1.5

    found = moved(walked(cycles(seed=1)), walked(cycles(worse, seed=2)))
    words = {one.series: one.word for one in found.metrics}
    assert words["left_knee.error_rms"] is Word.WORSE
    assert words["left_knee.torque_rms"] is Word.SAME
    one = next(one for one in found.metrics if one.series == "left_knee.error_rms")
    assert one.low is not None
    assert one.low > 0.0
    assert one.before == pytest.approx(0.005, rel=0.05)


def test_two_walks_alike_show_no_difference() -> None:
    found = moved(walked(cycles(seed=3)), walked(cycles(seed=4)))
    assert found.word is Word.SAME


def test_the_day_alone_is_named_where_anything_moved() -> None:
    """Nothing but the day: one metric a tenth off. That is sure of these two walks, and no more."""

    def other_day(_: float, values: dict[str, float]) -> None:
        values["left_knee.error_rms"] *= 1.1

    found = moved(walked(cycles(seed=5)), walked(cycles(other_day, seed=6)))
    assert found.word is not Word.SAME
    assert DAYS in found.notes
    assert DAYS not in moved(walked(cycles(seed=3)), walked(cycles(seed=4))).notes


def test_numbers_that_differ_late_are_not_alike() -> None:
    before = replace(OLD, parameters={"left_knee.gain": 1234567.0})
    found = compared(replace(OLD, parameters={"left_knee.gain": 1234568.0}), before)
    assert [(one.before, one.after) for one in found.differences] == [("1234567.0", "1234568.0")]


def test_a_parameter_is_told_with_its_unit_where_one_of_the_two_tells_it() -> None:
    told = {**SETUP, "object/gait.step_length": "controller m", "object/left_knee.gain": "0x6072:0"}
    after = replace(OLD, parameters={"left_knee.gain": 3.0, "gait.step_length": 0.41}, setup=told)
    gain, length = compared(after).differences
    assert (length.before, length.after, length.unit, length.numbers) == ("0.4 m", "0.41 m", "m", (0.4, 0.41))
    assert (gain.before, gain.after, gain.unit) == ("2", "3", "")
    gone = compared(replace(after, parameters={"left_knee.gain": 2.0})).unrecorded[0]
    assert (gone.before, gone.after, gone.unit) == ("0.4", "not recorded", None)


def test_a_session_without_walking_has_no_verdict() -> None:
    assert moved(walked(cycles()), walked([])).word in (Word.FEW, Word.NO_DATA)
    assert moved(Walk([], (), False), Walk([], (), False)).word in (Word.FEW, Word.NO_DATA)


def test_where_only_one_tells_the_activity_all_walking_is_compared() -> None:
    said = cycles(activity=lambda _: "walk")
    found = moved(walked(said, knows=True), walked(cycles(seed=2)))
    assert found.cycles_before > 50
    assert any("only one of them tells" in note for note in found.notes)
    assert np.isfinite([one.p for one in found.metrics if one.p is not None]).all()


def test_the_command_compares_two_recordings(
    folder_url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = record(folder_url, tmp_path / "one")
    other = record(folder_url, tmp_path / "other")
    typed = ["sessions", "changed", one.session, other.session, "--url", folder_url]
    assert main(typed) == 0
    told = capsys.readouterr().out
    assert "nothing that both tell was otherwise" in told
    assert "not recorded" in told
    assert "What moved with it: " in told
    assert "caus" not in told
    assert main([*typed, "--json", "--facts"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["changed"]["differences"] == []
    assert found["moved"] is None
