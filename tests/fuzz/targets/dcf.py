"""A device's configuration: read, and written into an EDS again."""

import math
from datetime import UTC, datetime

import eds
from eds import dcf
from tests.fuzz.files import as_file

TOKENS = (
    b"[DeviceComissioning]\n",
    b"NodeID=5\n",
    b"Baudrate=1000\n",
    b"[2000]\n",
    b"ParameterValue=",
    b"DataType=0x0008\n",
    b"[2000Value]\n",
    b"NrOfEntries=",
    b"$NODEID+1",
    b"0x",
    b"nan",
    b"inf",
    b"-1",
)
MODULES = ("eds.dcf",)
_NODE = dcf.Commissioning(5, "knee", "exo", 1_000_000)
_MADE = datetime(2026, 1, 2, 3, 4, tzinfo=UTC)


def fuzz(data: bytes) -> None:
    with as_file("node.dcf", data) as path:
        try:
            dcf.owner(path)
            found = dcf.read(path, 5)
        except eds.EdsError as error:
            assert str(error).startswith(f"{path}: ")
            return
        assert all(math.isfinite(value) for value in found.values.values())
        written = dcf.configured(data, "device.eds", "node.dcf", _NODE, found.values, _MADE)
    with as_file("again.dcf", written) as path:
        assert dcf.read(path, 5).values == found.values, "written and read again it is another"
