"""A damaged EDS is a clear error or a usable dictionary, never anything else."""

import tempfile
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

import eds
from eds.numbers import parse_integer
from tests.support.examples import examples

SOUND = b"""\
[DeviceInfo]
VendorName=Example
VendorNumber=0x1234
[DeviceComissioning]
NodeID=3
Baudrate=1000
[DummyUsage]
Dummy0001=0
[Comments]
Lines=1
Line1=text
[MandatoryObjects]
SupportedObjects=1
1=0x1000
[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x00020192
[1003]
ParameterName=Errors
ObjectType=0x8
DataType=0x0007
AccessType=ro
CompactSubObj=3
[1003Name]
NrOfEntries=1
2=Second
[1800]
ParameterName=TPDO
ObjectType=0x9
[1800sub0]
ParameterName=Entries
DataType=0x0005
AccessType=ro
[1800sub1]
ParameterName=COB-ID
DataType=0x0007
AccessType=rw
DefaultValue=$NODEID+0x180
ParameterValue=0x183
LowLimit=0
HighLimit=0xFFFFFFFF
[2000]
ParameterName=Gain
ObjectType=VAR
DataType=REAL32
AccessType=rw
LowLimit=-1.5
[2001]
ParameterName=Text
DataType=0x0009
AccessType=rw
DefaultValue=abc
"""

edits = st.lists(
    st.tuples(st.integers(0, len(SOUND) - 1), st.integers(0, 12), st.binary(max_size=12)),
    min_size=1,
    max_size=8,
)


def usable_or_refused(content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file.eds"
        path.write_bytes(content)
        try:
            description = eds.load(path, 5)
        except eds.EdsError:
            return
    assert description.object_dictionary.node_id == 5
    for index in description.object_dictionary:
        entry = description.object_dictionary[index]
        assert entry.index == index


@given(edits)
@settings(max_examples=examples(300))
def test_a_damaged_file_is_refused_or_usable(damage: list[tuple[int, int, bytes]]) -> None:
    content = SOUND
    for position, length, replacement in damage:
        content = content[:position] + replacement + content[position + length :]
    usable_or_refused(content)


@given(st.permutations(SOUND.splitlines(keepends=True)))
@settings(max_examples=examples(150))
def test_lines_in_any_order_are_refused_or_usable(lines: list[bytes]) -> None:
    usable_or_refused(b"".join(lines))


@given(st.binary(max_size=400))
def test_garbage_is_refused_or_usable(content: bytes) -> None:
    usable_or_refused(content)


@given(st.text(max_size=20) | st.text("0123456789abcdefxhuL+-$", max_size=6000))
def test_no_text_breaks_the_number_reader(text: str) -> None:
    assert parse_integer(text) is None or isinstance(parse_integer(text), int)


@given(st.integers(-(2**64), 2**64))
def test_every_spelling_of_a_number_is_the_same_number(number: int) -> None:
    spellings = [str(number), f"{number:#x}", f"{number:#X}" if number >= 0 else str(number)]
    assert {parse_integer(spelling) for spelling in spellings} == {number}
