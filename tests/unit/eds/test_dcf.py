"""DCFs: what is written is read by us and by others, what others wrote is read or refused in words."""

import configparser
import contextlib
import tempfile
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import canopen
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import eds
from eds import EdsError, dcf
from eds.datatypes import DATA_TYPES
from eds.dcf import Commissioning, Key, Number
from eds.shipped import SHIPPED, shipped
from tests.support.examples import examples

NOW = datetime(2026, 11, 21, 15, 7, tzinfo=UTC)
KNEE = Commissioning(5, "left_knee", "main", 1_000_000)


def made(folder: Path, text: bytes, values: Mapping[Key, Number], node: Commissioning = KNEE) -> Path:
    path = folder / "made.dcf"
    path.write_bytes(dcf.configured(text, "drive.eds", "made.dcf", node, values, NOW))
    return path


def numbers(file: Path) -> dict[Key, Number]:
    """A value for every writable number of a file, the type's largest or an uneven one."""
    found: dict[Key, Number] = {}
    for one in eds.load(file, 5).variables():
        known = DATA_TYPES[one.data_type or 0]
        if one.access_type in ("rw", "rwr", "rww") and known.kind in ("signed", "unsigned", "real"):
            signed = known.kind == "signed"
            number = -(1 << (known.bits or 0) - 1) if signed else (1 << (known.bits or 0)) - 1
            found[one.index, one.subindex] = 0.1 if known.kind == "real" else number
    return found


@pytest.mark.parametrize("name", shipped())
def test_every_number_of_a_real_file_comes_back_as_it_was_written(tmp_path: Path, name: str) -> None:
    values = numbers(SHIPPED / name)
    assert len(values) >= 25
    path = made(tmp_path, (SHIPPED / name).read_bytes(), values)
    found = dcf.read(path, 5)
    assert found.values == values
    assert dcf.owner(path) == (5, "left_knee")
    assert found.description.product == eds.load(SHIPPED / name, 5).product


def test_another_stack_reads_it(tmp_path: Path) -> None:
    values = {(0x6072, 0): 1500, (0x607D, 1): -90_000, (0x1017, 0): 50, (0x1600, 1): 0x60400010}
    path = made(tmp_path, (SHIPPED / "joint_drive.eds").read_bytes(), values)
    dictionary = canopen.import_od(str(path))
    assert (dictionary.node_id, dictionary.bitrate) == (5, 1_000_000)
    for (index, subindex), number in values.items():
        variable = dictionary.get_variable(index, subindex)
        assert variable is not None
        assert variable.value == number
    others = [one for one in eds.load(path, 5).variables() if (one.index, one.subindex) not in values]
    assert {one.value for one in others} == {None}


def test_it_says_whose_it_is_and_where_it_comes_from(tmp_path: Path) -> None:
    path = made(tmp_path, (SHIPPED / "joint_drive.eds").read_bytes(), {(0x1017, 0): 100, (0x6072, 0): 1500})
    parsed = configparser.ConfigParser(interpolation=None)
    parsed.read(path)
    assert dict(parsed["DeviceComissioning"]) == {
        "nodeid": "5",
        "nodename": "left_knee",
        "baudrate": "1000",
        "netnumber": "0",
        "networkname": "main",
        "canopenmanager": "0",
    }
    about = parsed["FileInfo"]
    assert (about["FileName"], about["LastEDS"]) == ("made.dcf", "drive.eds")
    assert (about["ModificationDate"], about["ModificationTime"]) == ("11-21-2026", "03:07PM")
    assert (parsed["1017"]["ParameterValue"], parsed["6072"]["ParameterValue"]) == ("0x64", "1500")


def test_all_else_of_the_file_stays_byte_for_byte(tmp_path: Path) -> None:
    text = (SHIPPED / "trinamic_tmcm_1270.eds").read_bytes()
    lines = made(tmp_path, text, {(0x2000, 0): 4}).read_bytes().splitlines(keepends=True)
    added = [line for line in lines if line not in text.splitlines(keepends=True)]
    assert any(line.startswith(b"ParameterValue=4") for line in added)
    before = [line for line in text.splitlines(keepends=True) if line in lines]
    left_out = [line for line in text.splitlines(keepends=True) if line not in lines]
    assert len(before) > 1000
    assert {line.partition(b"=")[0] for line in left_out} <= {
        b"FileName",
        b"ModificationTime",
        b"ModificationDate",
        b"ModifiedBy",
    }
    assert {line.endswith(b"\r\n") for line in lines} == {b"\r\n" in text}


def test_no_value_of_an_earlier_configuration_is_left(tmp_path: Path) -> None:
    before = (SHIPPED / "elmo_gold.dcf").read_bytes()
    assert eds.load(SHIPPED / "elmo_gold.dcf", 5).variable(0x60C2, 1).value == 10  # type: ignore[union-attr]
    once = made(tmp_path, before, {(0x6072, 0): 900})
    assert dcf.read(once, 5).values == {(0x6072, 0): 900}
    twice = made(tmp_path, once.read_bytes(), {(0x6073, 0): 800}, Commissioning(6, "hip"))
    assert (dcf.read(twice, 5).values, dcf.owner(twice)) == ({(0x6073, 0): 800}, (6, "hip"))
    assert twice.read_bytes().count(b"[DeviceComissioning]") == 1
    assert twice.read_bytes().count(b"LastEDS") == 1


def test_a_vendors_configuration_that_names_no_node_is_read() -> None:
    assert dcf.owner(SHIPPED / "elmo_gold.dcf") == (None, "")
    values = dcf.read(SHIPPED / "elmo_gold.dcf", 9).values
    assert (values[0x60C2, 1], values[0x1400, 1]) == (10, 0x209)


ODD = b"""\
\xef\xbb\xbf[DeviceInfo]
ProductName=B\xfcrste
[0x1003]
ParameterName=Array
ObjectType=8
DataType=5
AccessType=rw
CompactSubObj=3
[2001Sub01]
ParameterName=Speed
DataType=REAL32
AccessType=rw
PARAMETERVALUE = 9
[ 2002 ]
ParameterName=Offset
DataType=0x0004
AccessType=rw"""


def test_odd_spellings_are_found_and_compact_arrays_get_a_section_of_their_own(tmp_path: Path) -> None:
    values: dict[Key, Number] = {(0x1003, 1): 7, (0x1003, 3): 9, (0x2001, 1): 0.1, (0x2002, 0): -1}
    path = made(tmp_path, ODD, values)
    assert b"[1003Value]\nNrOfEntries=2\n1=0x7\n3=0x9\n" in path.read_bytes()
    assert b"B\xfcrste" in path.read_bytes()
    assert dcf.read(path, 5).values == values
    assert dcf.read(made(tmp_path, path.read_bytes(), {(0x2002, 0): 3}), 5).values == {(0x2002, 0): 3}


def test_a_value_that_the_eds_has_no_place_for_is_named() -> None:
    with pytest.raises(EdsError, match=r"drive.eds has no section for 0x3000:1; it is not the EDS"):
        dcf.configured(ODD, "drive.eds", "x.dcf", KNEE, {(0x3000, 1): 1}, NOW)


# Files from elsewhere

FOREIGN = """\
[DeviceInfo]
ProductName=Foreign
[DeviceCommissioning]
NodeID=0x11
NodeName=arm
[2001]
ParameterName=Speed
DataType=0x0003
AccessType=rw
ParameterValue={speed}
[1800]
ParameterName=COB-ID
DataType=0x0007
AccessType=rw
ParameterValue=$NODEID+0x180
[2002]
ParameterName=Gain
DataType=0x0008
AccessType=rw
ParameterValue=
[2003]
ParameterName=Name
DataType=0x0009
AccessType=rw
ParameterValue=Arm
"""


@pytest.mark.parametrize(("speed", "number"), [("-5", -5), ("0xFFFB", -5), ("0x10", 16), ("32767", 32767)])
def test_what_another_tool_wrote_is_read(tmp_path: Path, speed: str, number: int) -> None:
    path = tmp_path / "foreign.dcf"
    path.write_text(FOREIGN.format(speed=speed))
    assert dcf.read(path, 4).values == {(0x2001, 0): number, (0x1800, 0): 0x184}
    assert dcf.owner(path) == (17, "arm")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("ParameterValue={speed}", "ParameterValue=fast", "[2001] ParameterValue=fast is no INTEGER16"),
        ("ParameterValue={speed}", "ParameterValue=65536", "[2001] ParameterValue=65536 is no INTEGER16"),
        ("ParameterValue={speed}", "ParameterValue=010", "[2001] ParameterValue=010 is no INTEGER16"),
        ("ParameterValue={speed}", "ParameterValue 5", "line 10: 'ParameterValue 5' is no key=value line"),
        ("ParameterValue={speed}", "ParameterValue=1\nParameterValue=2", "stands twice with different"),
        ("ParameterValue=\n", "ParameterValue=nan\n", "[2002] ParameterValue=nan is no REAL32"),
        ("NodeID=0x11", "NodeID=0", "NodeID is '0', not 1 to 127"),
        ("NodeID=0x11", "NodeID=two", "NodeID is 'two', not 1 to 127"),
    ],
)
def test_what_is_broken_is_named_with_its_place(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "foreign.dcf"
    path.write_text(FOREIGN.replace(old, new).replace("{speed}", "5"))
    with pytest.raises(EdsError) as caught:
        dcf.read(path, dcf.owner(path)[0] or 1)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)


def test_an_eds_is_no_dcf(tmp_path: Path) -> None:
    with pytest.raises(EdsError, match="no object has a ParameterValue; this is an EDS"):
        dcf.read(SHIPPED / "joint_drive.eds", 5)
    with pytest.raises(EdsError, match="no object has a ParameterValue"):
        dcf.read(made(tmp_path, ODD, {}), 5)


@settings(max_examples=examples(200))
@given(st.data())
def test_a_damaged_file_is_read_or_refused_in_words(data: st.DataObject) -> None:
    text = bytearray(FOREIGN.replace("{speed}", "5").encode())
    for _ in range(data.draw(st.integers(1, 6))):
        place = data.draw(st.integers(0, len(text) - 1))
        text[place : place + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=3))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "damaged.dcf"
        path.write_bytes(text)
        with contextlib.suppress(EdsError):
            node_id, _name = dcf.owner(path)
            assert dcf.read(path, node_id or 1).values


def test_an_array_whose_section_stands_twice_keeps_its_values(tmp_path: Path) -> None:
    section = "[2003]\nParameterName=Y\nObjectType=8\nDataType=0x0007\nAccessType=rw\nCompactSubObj=3\n"
    path = made(tmp_path, (section + "[1000]\n" + section).encode(), {(0x2003, 1): 5, (0x2003, 3): 6})
    assert dcf.read(path, 5).values == {(0x2003, 1): 5, (0x2003, 3): 6}
