"""Nodes that are heard on a bus and that no table has are told; what is no node is not."""

import eds
from drivers.bus.bus import CanBus
from drivers.bus.node import shared_node
from drivers.bus.settings import CanSettings, DeviceSettings
from gateway.modules.component.findings import bus_infos


def test_a_node_that_is_heard_and_has_no_table_is_told() -> None:
    bus = CanBus("main", CanSettings(interface="virtual", channel="strangers"))
    settings = DeviceSettings(bus="main", node_id=2, eds="joint_drive.eds")
    shared_node(bus, 2, eds.load(eds.locate(settings.eds, None), 2), settings)
    bus.unclaimed |= {0x700, 0x702, 0x709, 0x715, 0x189, 0x780, 0x8000_0709}
    (told,) = bus_infos({"main": bus}, 0)
    assert told.strangers == [9, 21]
