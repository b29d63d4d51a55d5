"""A device's EDS."""

import eds
from tests.fuzz.files import as_file

TOKENS = (
    b"[1000]\n",
    b"[1018sub1]\n",
    b"[DeviceInfo]\n",
    b"ObjectType=0x7\n",
    b"DataType=0x0007\n",
    b"AccessType=rw\n",
    b"DefaultValue=",
    b"$NODEID+0x180\n",
    b"LowLimit=",
    b"HighLimit=",
    b"CompactSubObj=3\n",
    b"[1003Name]\n",
    b"ParameterName=",
    b"SubNumber=",
    b"0x",
    b"1e999",
    b"=",
)
MODULES = ("eds.loader", "eds.ini", "eds.repair", "eds.numbers")


def fuzz(data: bytes) -> None:
    with as_file("device.eds", data) as path:
        try:
            description = eds.load(path, 5)
        except eds.EdsError as error:
            assert str(error).startswith(f"{path}: ")
            return
    assert description.object_dictionary.node_id == 5
    for index in description.object_dictionary:
        assert description.object_dictionary[index].index == index
