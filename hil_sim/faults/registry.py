"""Every fault by its name."""

from collections.abc import Mapping

from hil_sim.faults import bus, drives, growing, host, nodes, sdo, sensors, wearer
from hil_sim.faults.fault import Fault

FAULTS: Mapping[str, Fault] = {
    **nodes.FAULTS,
    **sdo.FAULTS,
    **bus.FAULTS,
    **drives.FAULTS,
    **sensors.FAULTS,
    **growing.FAULTS,
    **wearer.FAULTS,
    **host.FAULTS,
}
