"""Every fault by its name."""

from collections.abc import Mapping

from hil_sim.faults import bus, drives, host, nodes, progressive, sdo, sensors, wearer
from hil_sim.faults.fault import Fault

FAULTS: Mapping[str, Fault] = {
    **nodes.FAULTS,
    **sdo.FAULTS,
    **bus.FAULTS,
    **drives.FAULTS,
    **sensors.FAULTS,
    **progressive.FAULTS,
    **wearer.FAULTS,
    **host.FAULTS,
}
