"""Attacks from the robot's own wires: frames on its bus, and bytes on its serial ports."""

from hil_sim.sensors.suite import INSOLES, SERIAL_IMUS, TRUNK
from tests.attack.attack import DeviceAttack
from tests.attack.on_bus import HOSTILE, LIAR, OF_A_DRIVE
from tests.bench._drives import DRIVES

_ALL = tuple(range(1, DRIVES + 1))
_OTHERS = tuple(node_id for node_id in _ALL if node_id != LIAR)
_ABOUT = {
    "bus-load": "a full bus of foreign frames",
    "pdo-lengths": "PDOs of wrong length",
    "emcy-flood": "EMCYs of every drive",
    "life-noise": "strange states and boot-ups",
    "sdo-answers": "bad SDO answers of one drive",
}

ATTACKS = (
    *(DeviceAttack(name, _ABOUT[name], _OTHERS if name in OF_A_DRIVE else _ALL) for name in HOSTILE),
    *(
        DeviceAttack(f"serial-{name}", f"hostile bytes as {name}", _ALL, insole=name, sensor="left_insole")
        for name in INSOLES
    ),
    *(
        DeviceAttack(f"serial-{name}", f"hostile bytes as {name}", _ALL, imu=name, sensor=TRUNK)
        for name in SERIAL_IMUS
    ),
)
