"""Who commands the drives is asked, so that a stop reaches it too and the check has nothing to warn of."""

import tomllib
from pathlib import Path

import pytest

from drivers.errors import SettingsError
from drivers.scan.identification import NodeAnswers
from drivers.scan.products import Library
from gateway.cli.commission import main
from gateway.commission.controller import controller
from gateway.commission.dialogue import run
from gateway.commission.draft import Draft
from gateway.commission.writing import text
from gateway.config.reading import examine
from tests.unit.commission.fake_bench import Hands

GAIT = NodeAnswers(0, 0, "gait", None, None, 0x0, 0x4A44_0002, None, 1, 100, (), ())
LIBRARY = Library([])


@pytest.fixture
def draft(tmp_path: Path) -> Draft:
    made = Draft(tmp_path / "exo-01.toml")
    for key, value in (("interface", "virtual"), ("channel", "x")):
        made.put("can.main", key, value)
    made.put("robot", "name", "exo-01")
    made.put("robot", "joints", ["left_knee"])
    made.put("gateway", "role", "observer")
    made.put("node.7", "eds", "joint_drive.eds")
    for key, number in (("node_id", 7), ("counts_per_revolution", 4096), ("gear_ratio", 100)):
        made.put("joint.left_knee", key, number)
    made.put("joint.left_knee", "zero_offset", 0.0)
    made.put("joint.left_knee", "configure_pdos", False)
    return made


def warned(draft: Draft) -> bool:
    draft.file.write_text(text(draft, "Ada", "now"), encoding="utf-8")
    found = examine(draft.file)
    assert found.config is not None, found.findings
    return any((one.where, one.key) == ("[stop]", "controller") for one in found.findings)


def test_the_object_that_stops_it_is_in_the_file_and_the_check_warns_no_more(draft: Draft) -> None:
    assert warned(draft)
    hands = Hands(
        ("Which node commands", lambda: "16"),
        ("which EDS", lambda: "gait_controller.eds"),
        ("Which of its objects", lambda: "0x2000"),
        ("Which of its objects", lambda: "0x7777:0"),
        ("Which of its objects", lambda: "0x2010:0"),
        ("Which of its objects", lambda: "0x2000:0"),
        ("Which value", lambda: "stop"),
        ("Which value", lambda: "0"),
    )
    run(controller(draft, LIBRARY, {16: GAIT}), hands)
    assert not warned(draft)
    assert tomllib.loads(draft.file.read_text(encoding="utf-8"))["stop"]["controller"] == [
        {"component": "controller", "object": "0x2000:0", "value": 0}
    ]
    again = Hands()
    run(controller(Draft(draft.file), LIBRARY, {16: GAIT}), again)
    assert again.read == []


def test_who_names_none_is_told_what_that_means_and_not_asked_again(draft: Draft) -> None:
    hands = Hands(("Which node commands", lambda: "none"))
    run(controller(draft, LIBRARY, {}), hands)
    assert hands.heard("A STOP will reach the drives only")
    assert warned(draft)
    again = Hands()
    run(controller(Draft(draft.file), LIBRARY, {}), again)
    assert again.heard("A STOP will reach the drives only"), "who goes on may be somebody else"


def test_on_a_bench_there_is_none_to_ask_for(draft: Draft) -> None:
    draft.put("gateway", "role", "master")
    run(controller(draft, LIBRARY, {16: GAIT}), hands := Hands())
    assert hands.read == []


@pytest.mark.parametrize("bus", ["", " ", "virtual:", ":can0"])
def test_a_bus_without_a_name_is_refused_before_anything_is_asked(tmp_path: Path, bus: str) -> None:
    with pytest.raises(SettingsError, match="names no bus"):
        main([str(tmp_path / "exo-01.toml"), bus])
    assert list(tmp_path.iterdir()) == []
