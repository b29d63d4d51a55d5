"""Any object of a device is found and read by a viewer; what is written still goes the way of parameters."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

import pytest

from drivers.errors import DeviceTimeout
from gateway.wire.limits import OBJECTS_READ
from gateway.wire.object_search import fitting
from tests.unit.gateway.harness import DISABLED, ROBOT, Bench, Client, config, serving

EDS = '\nparameters = "eds"\nrelease = ["profile_*"]\n'


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    made = Bench()
    monkeypatch.setattr("gateway.modules.component.module.assemble", made.assemble)
    for drive in (made.left, made.right):
        drive.set_state(DISABLED)
        drive.node.objects |= {
            (0x6081, 0): (65190).to_bytes(4, "little"),
            (0x6064, 0): (-5).to_bytes(4, "little", signed=True),
            (0x1008, 0): b"GWRMS joint drive",
        }
    return made


@pytest.fixture
def client(bench: Bench, tmp_path: Path) -> Iterator[Client]:
    text = ROBOT.replace("gear_ratio = 100.0\n", "gear_ratio = 100.0" + EDS, 1)
    with serving(config(tmp_path, text)) as address, Client(address) as asking:
        yield asking


@pytest.mark.parametrize(
    ("search", "found", "others"),
    [
        ("", 0x6041, None),
        ("0x6041", 0x6041, 0x6040),
        ("0x60*", 0x6041, 0x6502),
        ("0x6041-0x6060", 0x6041, 0x6061),
        ("0x6040…", 0x6041, 0x603F),
        ("0x6040...", 0x6041, 0x603F),
        ("0x6040-", 0x6041, 0x603F),
        ("STATUS word", 0x6041, 0x6040),
        ("0x6041:0", 0x6041, 0x6040),
    ],
)
def test_a_search_is_an_address_a_range_or_words(search: str, found: int, others: int | None) -> None:
    fits = fitting(search)
    assert fits(found, 0, "Statusword")
    assert others is None or not fits(others, 0, "Controlword")


def test_a_member_is_meant_by_its_sub_index() -> None:
    assert fitting("0x1018:4")(0x1018, 4, "Serial number")
    assert not fitting("0x1018:4")(0x1018, 3, "Revision number")


def test_an_object_is_told_with_its_type_limits_and_whether_it_may_be_written(client: Client) -> None:
    (velocity,) = client.call("object.list", component="left_knee", search="0x6081")["objects"]
    assert velocity["object"] == "0x6081:0"
    assert (velocity["type"], velocity["access"], velocity["max"]) == ("UNSIGNED32", "rw", 520000)
    assert (velocity["parameter"], velocity["read_only"]) == ("left_knee.profile_velocity", None)
    (controlword,) = client.call("object.list", component="left_knee", search="0x6040")["objects"]
    assert controlword["read_only"] == "controlword"
    (statusword,) = client.call("object.list", component="left_knee", search="0x6041")["objects"]
    assert (statusword["parameter"], statusword["read_only"]) == (None, "ro in the EDS")


def _listed(client: Client, search: str) -> dict[str, Any]:
    (found,) = client.call("object.list", component="left_knee", search=search)["objects"]
    return cast("dict[str, Any]", found)


@pytest.mark.parametrize(
    ("search", "why", "lines"),
    [
        ("0x6081:0", None, None),
        (
            "0x6065:0",
            'add "following_error_window" to release',
            '[joint.left_knee]\nrelease = ["profile_*", "following_error_window"]',
        ),
        (
            "0x607A:0",
            "a glob does not reach it",
            '[joint.left_knee]\nrelease = ["profile_*", "target_position"]',
        ),
        (
            "0x1017:0",
            "belongs to who leads it",
            '[parameter."left_knee.producer_heartbeat_time"]\nobject = "0x1017:0"',
        ),
        ("0x1010:1", "gwrms store", None),
        ("0x6040:0", "it enables drives", None),
        ("0x1008:0", "its EDS says const", None),
        ("0x6041:0", "its EDS says ro", None),
    ],
)
def test_what_is_locked_says_why_and_the_lines_that_release_it(
    client: Client, search: str, why: str | None, lines: str | None
) -> None:
    found = _listed(client, search)
    assert found["release"] == lines
    assert found["locked"] is None if why is None else why in found["locked"]


def test_what_the_file_offers_nothing_of_is_released_by_a_table_of_its_own(client: Client) -> None:
    (found,) = client.call("object.list", component="right_knee", search="0x6065:0")["objects"]
    assert found["parameter"] is None
    assert "it is no parameter" in found["locked"]
    (mode,) = client.call("object.list", component="right_knee", search="0x605A:0")["objects"]
    assert "beware: it decides how the drive stops" in mode["locked"]
    assert found["release"] == '[parameter."right_knee.following_error_window"]\nobject = "0x6065:0"'


def test_an_object_names_the_pdos_that_bring_it(client: Client) -> None:
    assert "TPDO1" in _listed(client, "0x6041:0")["pdos"]
    assert "RPDO1" in _listed(client, "0x6040:0")["pdos"]
    assert _listed(client, "0x6065:0")["pdos"] == []


def test_what_is_too_much_for_one_answer_is_counted(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gateway.modules.control.dictionary.OBJECTS_LISTED", 3)
    answer = client.call("object.list", component="left_knee", search="0x60*")
    assert len(answer["objects"]) == 3
    assert answer["left_off"] > 10


def test_numbers_texts_and_states_are_read(client: Client) -> None:
    objects = ["0x6041:0", "0x6064:0", "0x1008:0", "0x6081:0"]
    values = client.call("object.read", component="left_knee", objects=objects)["values"]
    assert list(values) == objects
    assert values["0x6064:0"]["value"] == -5
    assert values["0x1008:0"]["value"] == "GWRMS joint drive"
    assert "switch on disabled" in values["0x6041:0"]["words"]
    assert all(value["problem"] is None and value["stamp_ns"] for value in values.values())


def test_nothing_is_written_by_looking(client: Client, bench: Bench) -> None:
    client.call("object.list", component="left_knee")
    client.call("object.read", component="left_knee", objects=["0x6041:0"])
    assert bench.left.node.written() == []


def test_what_the_device_does_not_tell_says_why(client: Client, bench: Bench) -> None:
    del bench.left.node.objects[0x6064, 0]
    values = client.call("object.read", component="left_knee", objects=["0x6064:0", "0x6081:0"])["values"]
    assert values["0x6064:0"]["value"] is None
    assert values["0x6064:0"]["problem"]
    assert values["0x6081:0"]["value"] == 65190


def test_a_device_that_does_not_answer_is_not_asked_again_at_once(client: Client, bench: Bench) -> None:
    def silent(_index: int) -> None:
        raise DeviceTimeout("no answer")

    bench.left.node.before_upload = silent
    first = client.call("object.read", component="left_knee", objects=["0x6041:0"])["values"]
    assert "no answer" in first["0x6041:0"]["problem"]
    bench.left.node.log.clear()
    second = client.call("object.read", component="left_knee", objects=["0x6064:0"])["values"]
    assert "is asked again in" in second["0x6064:0"]["problem"]
    assert bench.left.node.log == []


def test_a_device_that_is_not_there_is_told(client: Client, bench: Bench) -> None:
    bench.left.node.ready = False
    (value,) = client.call("object.read", component="left_knee", objects=["0x6041:0"])["values"].values()
    assert "left_knee is not there" in value["problem"]


@pytest.mark.parametrize(
    ("params", "kind"),
    [
        ({"component": "left_kne", "objects": ["0x6041:0"]}, "unknown_name"),
        ({"component": "left_knee", "objects": ["0x5FFF:0"]}, "unknown_name"),
        ({"component": "left_knee", "objects": ["0x6041:999"]}, "unknown_name"),
        ({"component": "left_knee", "objects": ["6041"]}, None),
        ({"component": "left_knee", "objects": []}, None),
        ({"component": "left_knee", "objects": ["0x6041:0"] * (OBJECTS_READ + 1)}, None),
    ],
)
def test_what_cannot_be_read_is_refused(client: Client, params: dict[str, object], kind: str | None) -> None:
    error = client.refused("object.read", **params)
    assert error.code == -32602 if kind is None else error.kind == kind
