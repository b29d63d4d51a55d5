"""Files broken the way vendors break them load, and say what was repaired."""

from pathlib import Path

import pytest

import eds
from eds.report import pdo_rows

HEAD = """\
[FileInfo]
FileName=drive.eds

[DeviceInfo]
VendorName=Example
VendorNumber=0x1234
ProductName=Drive
ProductNumber=0x42
BaudRate_1000=1

[DummyUsage]
Dummy0001=0
Dummy0002=0
Dummy0003=0
Dummy0004=0
Dummy0005=1
Dummy0006=0
Dummy0007=0

[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x00020192
PDOMapping=0

"""


def variable(section: str, **keys: str) -> str:
    """One object section; keys given replace those of a good one, an empty one is left out."""
    lines = {
        "ParameterName": f"Object {section}",
        "ObjectType": "0x7",
        "DataType": "0x0007",
        "AccessType": "rw",
    }
    lines |= keys
    body = "\n".join(f"{key}={value}" for key, value in lines.items() if value != "-")
    return f"[{section}]\n{body}\n\n"


def load(folder: Path, body: str, node_id: int = 5, head: str = HEAD) -> eds.Description:
    path = folder / "drive.eds"
    path.write_bytes((head + body).encode("utf-8"))
    return eds.load(path, node_id)


def warnings(description: eds.Description) -> list[str]:
    return [f"{finding.where} {finding.text}" for finding in description.findings]


def default(description: eds.Description, index: int, subindex: int = 0) -> object:
    found = description.variable(index, subindex)
    assert found is not None
    return found.default


def test_a_sound_file_loads_without_findings(tmp_path: Path) -> None:
    description = load(tmp_path, variable("6064", DataType="0x0004"))
    assert description.findings == ()
    assert (description.vendor, description.product) == ("Example", "Drive")
    assert (description.vendor_id, description.product_code) == (0x1234, 0x42)
    assert description.has(0x6064)
    assert not description.has(0x6041)


def test_sections_and_keys_may_differ_in_case(tmp_path: Path) -> None:
    body = "[607a]\nPARAMETERNAME=Target\nobjecttype=0X7\ndatatype=0X0004\nACCESSTYPE=RW\ndefaultvalue=0X10\n"
    body += "[1018]\nParameterName=Identity\nObjectType=9\n"
    body += "[1018SUB1]\nParameterName=Vendor\nDataType=7\nAccessType=RO\n"
    description = load(
        tmp_path, body, head=HEAD.replace("[DeviceInfo]", "[DEVICEINFO]").replace("Dummy0005", "DUMMY0005")
    )
    assert description.vendor == "Example"
    assert default(description, 0x607A) == 0x10
    assert description.has(0x1018, 1)
    assert description.findings == ()


@pytest.mark.parametrize("key", ["ObjectType", "PDOMapping", "DefaultValue", "LowLimit", "HighLimit"])
def test_an_empty_number_in_an_object_is_left_out(tmp_path: Path, key: str) -> None:
    description = load(tmp_path, variable("2000", **{key: ""}))
    found = description.variable(0x2000)
    assert found is not None
    assert (found.default, found.min, found.max) == (None, None, None)


def test_an_empty_number_in_the_device_information_is_reported(tmp_path: Path) -> None:
    head = HEAD.replace("ProductNumber=0x42", "ProductNumber=").replace("BaudRate_1000=1", "BaudRate_1000=")
    description = load(tmp_path, variable("2000"), head=head)
    assert description.product_code is None
    assert warnings(description) == [
        "[DeviceInfo] ProductNumber is empty; left out",
        "[DeviceInfo] BaudRate_1000 is empty; left out",
    ]


def test_object_and_data_types_may_be_names(tmp_path: Path) -> None:
    body = variable("2000", ObjectType="VAR", DataType="REAL32", DefaultValue="1.5")
    body += "[2001]\nParameterName=List\nObjectType=ARRAY\nSubNumber=2\n"
    body += variable("2001sub0", ObjectType="VAR", DataType="UNSIGNED8") + variable(
        "2001sub1", DataType="INTEGER32"
    )
    description = load(tmp_path, body)
    assert default(description, 0x2000) == 1.5
    assert description.has(0x2001, 1)
    assert "[2000] ObjectType the name 'VAR' stands for the number 7" in warnings(description)


def test_missing_dummy_entries_are_taken_as_unused(tmp_path: Path) -> None:
    description = load(tmp_path, variable("2000"), head=HEAD.replace("Dummy0003=0\n", ""))
    assert warnings(description) == ["[DummyUsage] Dummy0003 missing; taken as 0"]


def test_the_first_of_two_equal_sections_counts(tmp_path: Path) -> None:
    body = variable("2000", DefaultValue="1") + variable("2000", DefaultValue="2", LowLimit="0")
    description = load(tmp_path, body)
    found = description.variable(0x2000)
    assert found is not None
    assert (found.default, found.min) == (1, 0)
    assert any("the section stands twice" in text for text in warnings(description))
    assert any("'1' counts, not '2'" in text for text in warnings(description))


def test_a_sub_object_without_its_object_makes_a_record(tmp_path: Path) -> None:
    description = load(tmp_path, variable("2000sub1", DefaultValue="7"))
    assert default(description, 0x2000, 1) == 7
    assert "[2000] is missing, but has sub-objects; read as a RECORD" in warnings(description)


def test_an_object_called_var_that_has_sub_objects_is_a_record(tmp_path: Path) -> None:
    description = load(tmp_path, variable("2000", ObjectType="0x7") + variable("2000sub1", DefaultValue="7"))
    assert default(description, 0x2000, 1) == 7


def test_a_missing_data_type_means_plain_bytes_and_is_a_warning(tmp_path: Path) -> None:
    description = load(tmp_path, variable("2000", DataType="-"))
    assert [finding.severity for finding in description.findings] == ["warning"]
    found = description.variable(0x2000)
    assert found is not None
    assert found.data_type == 0x0F


def test_a_missing_or_unknown_access_type_is_never_writable(tmp_path: Path) -> None:
    description = load(tmp_path, variable("2000", AccessType="-") + variable("2001", AccessType="maybe"))
    for index in (0x2000, 0x2001):
        found = description.variable(index)
        assert found is not None
        assert not found.writable
    assert len(description.findings) == 2


def test_a_missing_name_is_replaced_by_the_index(tmp_path: Path) -> None:
    found = load(tmp_path, variable("2000", ParameterName="-")).variable(0x2000)
    assert found is not None
    assert found.name == "2000"


def test_a_data_type_defined_in_the_file_is_followed(tmp_path: Path) -> None:
    body = variable("2000", DataType="0x00A0", DefaultValue="9")
    body += "[A0]\nParameterName=Own type\nObjectType=0x6\nSubNumber=2\n[A0sub1]\nDefaultValue=0x06\n"
    found = load(tmp_path, body).variable(0x2000)
    assert found is not None
    assert (found.data_type, found.default) == (6, 9)


def test_a_compact_array_gives_its_unnamed_entries_a_name(tmp_path: Path) -> None:
    body = variable("2000", ObjectType="0x8", CompactSubObj="3") + "[2000Name]\nNrOfEntries=1\n2=Middle\n"
    description = load(tmp_path, body)
    names = [found.name for entry in (1, 2, 3) if (found := description.variable(0x2000, entry)) is not None]
    assert names == ["Object 20001", "Middle", "Object 20003"]


@pytest.mark.parametrize(("type_", "limits"), [("0x0008", (-1.5, 2.5)), ("0x0003", (-3, 4))])
def test_limits_of_a_compact_array_are_its_entries_not_its_counts(
    tmp_path: Path, type_: str, limits: tuple[float, float]
) -> None:
    low, high = limits
    body = variable(
        "2000", ObjectType="8", CompactSubObj="3", DataType=type_, LowLimit=f"{low}", HighLimit=f"{high}"
    )
    description = load(tmp_path, body)
    found = [description.variable(0x2000, entry) for entry in range(4)]
    assert [one and (one.min, one.max) for one in found] == [(None, None), limits, limits, limits]


def test_an_entry_of_a_compact_array_with_a_section_of_its_own_has_its_own_limits(tmp_path: Path) -> None:
    body = variable("2000", ObjectType="8", CompactSubObj="2", DataType="0x000F", LowLimit="0xFFFF")
    body += variable("2000sub0", DataType="0x0008") + variable("2000sub1", DataType="0x0008", HighLimit="2.5")
    found = load(tmp_path, body).variable(0x2000, 1)
    assert found is not None
    assert (found.min, found.max) == (None, 2.5)


def test_a_number_that_reads_as_octal_and_as_decimal_is_not_guessed(tmp_path: Path) -> None:
    description = load(
        tmp_path, variable("2000", DefaultValue="0010") + variable("2001", DefaultValue="0007")
    )
    assert default(description, 0x2000) is None
    assert default(description, 0x2001) == 7
    assert warnings(description) == ["[2000] DefaultValue '0010' is no clear UNSIGNED32; left out"]


def test_limits_of_reals_and_negative_hex_are_kept(tmp_path: Path) -> None:
    body = variable("2000", DataType="0x0008", LowLimit="-1.5", HighLimit="2.5")
    body += variable("2001", DataType="0x0010", LowLimit="0xFFFFFF", HighLimit="5")
    description = load(tmp_path, body)
    real, integer24 = description.variable(0x2000), description.variable(0x2001)
    assert real is not None
    assert integer24 is not None
    assert (real.min, real.max) == (-1.5, 2.5)
    assert (integer24.min, integer24.max) == (-1, 5)


def test_limits_that_contradict_each_other_are_kept_and_reported(tmp_path: Path) -> None:
    description = load(tmp_path, variable("2000", LowLimit="5", HighLimit="1"))
    found = description.variable(0x2000)
    assert found is not None
    assert (found.min, found.max) == (5, 1)
    assert warnings(description) == ["[2000] LowLimit 5 is above HighLimit 1; no value is allowed"]


def test_a_limit_that_is_no_number_is_none_and_is_reported(tmp_path: Path) -> None:
    description = load(tmp_path, variable("2000", DataType="0x0008", LowLimit="nan", HighLimit="2.5"))
    found = description.variable(0x2000)
    assert found is not None
    assert (found.min, found.max) == (None, 2.5)
    assert warnings(description) == ["[2000] LowLimit 'nan' is no clear REAL32; left out"]


@pytest.mark.parametrize("text", ["$NODEID+0x180", "0x180+$NODEID", "NODEID + 0x180", "$NodeId+384"])
def test_a_cob_id_follows_the_configured_node(tmp_path: Path, text: str) -> None:
    body = "[1800]\nParameterName=TPDO\nObjectType=9\n" + variable("1800sub1", DefaultValue=text)
    assert default(load(tmp_path, body, node_id=5), 0x1800, 1) == 0x185


def test_the_nodes_of_one_file_have_a_dictionary_each(tmp_path: Path) -> None:
    body = "[1800]\nParameterName=TPDO\nObjectType=9\n" + variable("1800sub1", DefaultValue="$NODEID+0x180")
    first, second, again = (load(tmp_path, body, node_id=node_id) for node_id in (5, 6, 5))
    changed = first.variable(0x1800, 1)
    assert changed is not None
    changed.default = 0
    assert (default(second, 0x1800, 1), default(again, 0x1800, 1)) == (0x186, 0x185)
    assert [one.object_dictionary.node_id for one in (first, second, again)] == [5, 6, 5]


def dcf(**keys: str) -> str:
    pdo = "[1800]\nParameterName=TPDO\nObjectType=9\n" + variable("1800sub1", **keys)
    return "[DeviceComissioning]\nNodeID=1\nBaudrate=1000\n" + pdo


def test_a_dcf_for_another_node_never_overrides_the_configured_one_silently(tmp_path: Path) -> None:
    description = load(tmp_path, dcf(DefaultValue="0x181", ParameterValue="0x40000181"), node_id=5)
    found = description.variable(0x1800, 1)
    assert found is not None
    assert (found.default, found.value) == (0x185, 0x40000185)
    assert description.object_dictionary.node_id == 5
    assert warnings(description) == [
        "[DeviceComissioning] NodeID the file is for node 1; 5 is configured and counts",
        "[1800sub1] DefaultValue 0x181 belongs to node 1; read as 0x180 + 5",
        "[1800sub1] ParameterValue 0x181 belongs to node 1; read as 0x180 + 5",
    ]


def test_a_fixed_cob_id_of_an_unnamed_node_is_kept_and_reported(tmp_path: Path) -> None:
    body = "[1800]\nParameterName=TPDO\nObjectType=9\n" + variable("1800sub1", DefaultValue="0x183")
    description = load(tmp_path, body, node_id=5)
    assert default(description, 0x1800, 1) == 0x183
    assert warnings(description) == [
        "[1800sub1] DefaultValue COB-ID 0x183 is fixed and belongs to node 3, not 5"
    ]


def test_a_bom_blanks_crlf_and_broken_lines_do_no_harm(tmp_path: Path) -> None:
    body = "stray line\n  [ 2000 ]  ; comment\n ParameterName = A\n DataType = 0x0007 ; u32\nAccessType=rw\n"
    body += "[2001\nDataType=7\n"
    path = tmp_path / "drive.eds"
    path.write_bytes(b"\xef\xbb\xbflost=1\r\n" + (HEAD + body).replace("\n", "\r\n").encode())
    description = eds.load(path, 5)
    assert description.has(0x2000)
    assert description.has(0x2001)
    assert any("before the first section" in text for text in warnings(description))
    assert any("no key=value line" in text for text in warnings(description))
    assert any("is not closed" in text for text in warnings(description))


def test_a_latin_1_name_is_read(tmp_path: Path) -> None:
    path = tmp_path / "drive.eds"
    path.write_bytes((HEAD + variable("2000", ParameterName="Größe")).encode("cp1252"))
    found = eds.load(path, 5).variable(0x2000)
    assert found is not None
    assert found.name == "Größe"


def test_objects_listed_but_not_described_are_reported(tmp_path: Path) -> None:
    description = load(tmp_path, "[OptionalObjects]\nSupportedObjects=2\n1=0x1000\n2=0x1017\n")
    assert warnings(description) == ["[optionalobjects] lists objects without a section: 0x1017"]


@pytest.mark.parametrize(
    "content", [b"", b"\x00" * 64, b"<html>", b"[FileInfo]\nFileName=x\n", b"[1000sub]\n"]
)
def test_a_file_that_is_no_eds_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "wrong.eds"
    path.write_bytes(content)
    with pytest.raises(eds.EdsError, match=r"wrong\.eds: there is no object section"):
        eds.load(path, 5)


def test_a_missing_file_and_a_wrong_node_id_are_refused(tmp_path: Path) -> None:
    with pytest.raises(eds.EdsError, match=r"absent\.eds: cannot be read"):
        eds.load(tmp_path / "absent.eds", 5)
    with pytest.raises(eds.EdsError, match="node id 128 is outside"):
        eds.load(tmp_path / "absent.eds", 128)


def test_what_a_purpose_needs_and_the_file_lacks_is_named(tmp_path: Path) -> None:
    description = load(tmp_path, variable("6041", DataType="0x0006"))
    with pytest.raises(eds.EdsError, match=r"0x6064 \(position\) missing, which a joint needs"):
        description.require([(0x6041, "statusword"), (0x6064, "position")], "a joint")


def test_a_file_is_found_beside_the_robots_file(tmp_path: Path) -> None:
    (tmp_path / "own.eds").write_text("x")
    assert eds.locate("own.eds", tmp_path / "robot.toml") == tmp_path / "own.eds"
    with pytest.raises(eds.EdsError, match=r"no EDS file 'none\.eds'"):
        eds.locate("none.eds", tmp_path / "robot.toml")


@pytest.mark.parametrize(
    ("name", "meant"), [("my_drvie.eds", "my_drive.eds"), ("joint_drvie.eds", "joint_drive.eds")]
)
def test_a_file_that_was_likely_meant_is_named(tmp_path: Path, name: str, meant: str) -> None:
    (tmp_path / "my_drive.eds").write_text("x")
    with pytest.raises(eds.EdsError, match=f"did you mean '{meant}'"):
        eds.locate(name, tmp_path / "robot.toml")


def test_no_entry_of_an_array_is_invented(tmp_path: Path) -> None:
    body = "[2000]\nParameterName=List\nObjectType=8\n"
    body += variable("2000sub0", DataType="5") + variable("2000sub1") + variable("2001")
    body += variable("2002", ObjectType="8", CompactSubObj="2")
    description = load(tmp_path, body)
    assert [subindex for subindex in range(6) if description.has(0x2000, subindex)] == [0, 1]
    assert [subindex for subindex in range(6) if description.has(0x2001, subindex)] == [0]
    assert [subindex for subindex in range(6) if description.has(0x2002, subindex)] == [0, 1, 2]


MASTER = """\
[1400]
ParameterName=RPDO communication parameter
ObjectType=0x09
[1400sub1]
ParameterName=COB-ID
DataType=0x0007
AccessType=rw
DefaultValue=0x00000182
[1600]
ParameterName=RPDO mapping parameter
ObjectType=0x09
DataType=0x0007
AccessType=rw
CompactSubObj=2

[1600Value]
NrOfEntries=2
1=0x20000020
2=0x2001{bits}

[1A01]
ParameterName=TPDO mapping parameter
ObjectType=0x09
[1A01sub0]
ParameterName=Count
DataType=0x0005
AccessType=rw
[1A01sub1]
ParameterName=First
DataType=0x0007
AccessType=rw
DefaultValue=0x60410010
[1801]
ParameterName=TPDO
ObjectType=9
[1801sub1]
ParameterName=COB-ID
DataType=0x0007
AccessType=rw
"""


def test_compactly_stored_values_are_the_entries_values(tmp_path: Path) -> None:
    description = load(tmp_path, MASTER.replace("{bits}", "0120"))
    found = [description.variable(0x1600, entry) for entry in range(3)]
    assert [one and (one.default, one.value) for one in found] == [
        (2, None), (None, 0x20000020), (None, 0x20010120),
    ]  # fmt: skip
    tpdo, rpdo = pdo_rows(description)
    assert (rpdo.name, rpdo.cob_id, rpdo.enabled) == ("RPDO1", 0x182, True)
    assert rpdo.mapped == ((0x2000, 0, 32), (0x2001, 1, 32))
    assert (tpdo.cob_id, tpdo.enabled, tpdo.mapped) == (None, None, ((0x6041, 0, 16),))
    assert description.findings == ()  # not that the RPDO listens to node 2 either


def test_a_listed_value_without_its_sub_object_is_told(tmp_path: Path) -> None:
    description = load(tmp_path, variable("2000") + "[2000Value]\nNrOfEntries=1\n9=4\n")
    assert warnings(description) == ["[2000value] 9 '4' is for a sub-object that the file lacks; left out"]


@pytest.mark.parametrize(
    ("type_", "text", "value"),
    [
        ("0x0004", "0x80000001", -0x7FFFFFFF),
        ("0x0002", "0xFD", -3),
        ("0x0002", "253", -3),
        ("0x10", "0xFFFFFF", -1),
    ],
)
def test_a_signed_value_written_in_hexadecimal_is_negative(
    tmp_path: Path, type_: str, text: str, value: int
) -> None:
    description = load(tmp_path, variable("2000", DataType=type_, DefaultValue=text, ParameterValue=text))
    found = description.variable(0x2000)
    assert found is not None
    assert (found.default, found.value) == (value, value)
    assert description.findings == ()


def test_a_value_outside_its_type_is_left_out_and_told(tmp_path: Path) -> None:
    description = load(tmp_path, variable("2000", DataType="5", DefaultValue="256"))
    assert default(description, 0x2000) is None
    assert warnings(description) == ["[2000] DefaultValue '256' is outside UNSIGNED8; left out"]


@pytest.mark.parametrize("name", ["2100subindex2", "6064h", "2100sub"])
def test_a_section_that_nobody_reads_is_told(tmp_path: Path, name: str) -> None:
    (text,) = warnings(load(tmp_path, variable(name)))
    assert text == f"[{name}] is no object like [2100] and no sub-object like [2100sub2]; left out"


def test_objects_of_modules_and_links_are_no_objects(tmp_path: Path) -> None:
    description = load(tmp_path, variable("M1SubExt6000") + "[1000ObjectLinks]\nObjectLinks=0\n")
    assert warnings(description) == [
        "[m1subext6000] describes an object of a plug-in module, which is not read"
    ]


def test_an_array_without_sub_objects_is_told(tmp_path: Path) -> None:
    (text,) = warnings(load(tmp_path, variable("2000", ObjectType="8")))
    assert text == "[2000] is an ARRAY without sub-objects; nothing of it can be read or written"


def test_a_count_of_entries_that_is_none_is_told(tmp_path: Path) -> None:
    texts = warnings(load(tmp_path, variable("2000", ObjectType="8", CompactSubObj="300")))
    assert texts[0] == "[2000] CompactSubObj is '300', not 0 to 254; no entry is known"


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le"])
def test_a_file_in_utf_16_is_read(tmp_path: Path, encoding: str) -> None:
    text = HEAD + variable("2000", DefaultValue="4")
    path = tmp_path / "drive.eds"
    path.write_bytes((b"" if encoding == "utf-16" else b"\xff\xfe") + text.encode(encoding))
    assert default(eds.load(path, 5), 0x2000) == 4


def test_an_xdd_is_called_one(tmp_path: Path) -> None:
    path = tmp_path / "drive.xdd"
    path.write_text('<?xml version="1.0"?>\n<ISO15745ProfileContainer/>')
    with pytest.raises(eds.EdsError, match=r"drive.xdd: is XML, so likely an XDD or XDC file \(CiA 311\)"):
        eds.load(path, 5)
