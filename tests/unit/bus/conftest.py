"""A bus on a virtual channel of the test's own, a description of a small device, and one with its worker."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import eds
from drivers.bus.bus import CanBus
from drivers.bus.sdo.worker import SdoWorker
from drivers.bus.settings import CanSettings
from tests.unit.bus.sdo_device import Device

IDENTITY = {
    (0x1000, 0): (0x00020192).to_bytes(4, "little"),
    (0x1018, 1): (0x1234).to_bytes(4, "little"),
    (0x1018, 2): (0x42).to_bytes(4, "little"),
    (0x1017, 0): (0).to_bytes(2, "little"),
}

SMALL_EDS = """
[DeviceInfo]
VendorNumber=0x1234
ProductNumber=0x42
[1000]
ParameterName=Device type
DataType=7
AccessType=ro
[1014]
ParameterName=COB-ID EMCY
DataType=7
AccessType=rw
DefaultValue=$NODEID+0x80
[1017]
ParameterName=Producer heartbeat time
DataType=6
AccessType=rw
[1018]
ParameterName=Identity
ObjectType=9
[1018sub1]
ParameterName=Vendor
DataType=7
AccessType=ro
[1018sub2]
ParameterName=Product
DataType=7
AccessType=ro
[2001]
ParameterName=Step length
DataType=6
AccessType=rw
"""


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    """A virtual channel of this test alone."""
    return str(request.node.nodeid)


@pytest.fixture
def bus(channel: str) -> CanBus:
    """Not open yet: a node opens it."""
    return CanBus("main", CanSettings(interface="virtual", channel=channel))


@pytest.fixture
def describe(tmp_path: Path) -> Callable[[int], eds.Description]:
    """The small device's description, for a node id."""

    def load(node_id: int, text: str = SMALL_EDS) -> eds.Description:
        path = tmp_path / "small.eds"
        path.write_text(text)
        return eds.load(path, node_id)

    return load


@pytest.fixture
def device() -> Device:
    return Device()


@pytest.fixture
def worker(device: Device) -> Iterator[SdoWorker]:
    worker = SdoWorker(device.channel)
    worker.start()
    yield worker
    worker.stop()
