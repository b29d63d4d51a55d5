"""Every finding of the doctor: its name, what it looks at, what it means, and who judges it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from gateway.doctor.observations import Observations
from gateway.doctor.rules import components, computer, drive, motion, node, trunk, wire
from gateway.doctor.verdicts import Fix, Unknown, Verdict, Write

Judge = Callable[[Observations], Iterator[Verdict]]


@dataclass(frozen=True, slots=True)
class DoctorRule:
    """One finding; `looks` says by what it is judged."""

    name: str
    meaning: str
    looks: str
    judge: Judge


RULES: tuple[DoctorRule, ...] = (
    DoctorRule(
        "bit_rate", "the devices talk at another bit rate", "bus: error frames, no frame", wire.bit_rate
    ),
    DoctorRule(
        "terminator",
        "no terminator, one too many, or a short",
        "bus: error frames among frames",
        wire.terminator,
    ),
    DoctorRule(
        "double_node_id",
        "two devices have one node id",
        "bus: heartbeats, PDOs beside SYNC",
        wire.double_node_id,
    ),
    DoctorRule(
        "second_sdo_client",
        "somebody else asks on our SDO channel",
        "bus: SDO requests",
        wire.second_sdo_client,
    ),
    DoctorRule("bus_load", "the bus is too busy", "bus: load, identifiers", wire.bus_load),
    DoctorRule(
        "eds_product", "the EDS is of another product or revision", "objects: 1018h", node.eds_product
    ),
    DoctorRule("heartbeat", "no heartbeat, or slower than the guard", "objects: 1017h; bus", node.heartbeat),
    DoctorRule("sync", "no SYNC, or too slow for the PDOs", "bus: 80h; objects: 1800h, 60C2h", node.sync),
    DoctorRule("pdo_mapping", "position or state is in no PDO", "objects: 1800h, 1A00h", node.pdo_mapping),
    DoctorRule(
        "velocity_unit",
        "velocity is in another unit",
        "walking: velocity beside position",
        drive.velocity_unit,
    ),
    DoctorRule(
        "mode",
        "the mode of operation is not the mode it is commanded in",
        "objects: 6061h, 1600h",
        drive.mode,
    ),
    DoctorRule(
        "current_limit",
        "current limit unset, or above the motor's",
        "objects: 6073h, 6075h",
        drive.current_limit,
    ),
    DoctorRule(
        "following_window", "the following error is not watched", "objects: 6065h", drive.following_window
    ),
    DoctorRule("reaction", "moves on when its master dies", "objects: 605Ah, 6007h", drive.reaction),
    DoctorRule(
        "gear",
        "counts or gear ratio are off",
        "objects: 608Fh, 6091h; walking: left beside right",
        motion.gear,
    ),
    DoctorRule(
        "sign", "a joint's sign is flipped", "walking: joint over the stride of its foot", motion.sign
    ),
    DoctorRule("sides", "left and right are swapped", "walking: joints beside insoles", motion.sides),
    DoctorRule("zero", "a joint's zero is off", "walking: left beside right", motion.zero),
    DoctorRule(
        "insole_scale", "an insole's scale is off", "walking: force under each foot", motion.insole_scale
    ),
    DoctorRule(
        "imu", "the IMU's axes are wrong, or it is frozen", "standing: gravity; walking: sway", trunk.imu
    ),
    DoctorRule(
        "component",
        "a driver says that something else is wrong, a controller is held, or a bus has no interface",
        "channels: quality, state; computer: CAN interfaces",
        components.component,
    ),
    DoctorRule(
        "latency_timer", "a USB serial adapter gathers bytes", "computer: /sys", computer.latency_timer
    ),
    DoctorRule("clock", "the clock is not synchronised", "computer: adjtimex", computer.clock),
    DoctorRule("governor", "the cores save power", "computer: /sys", computer.governor),
    DoctorRule("realtime", "no real-time priority", "computer: limits", computer.realtime),
    DoctorRule("txqueuelen", "the CAN interface's queue is too short", "computer: /sys", computer.txqueuelen),
)


def judged(seen: Observations) -> Iterator[Verdict]:
    """Yield the verdicts of every rule, in the table's order.

    Values to be written are in their parameters' units.
    """
    every = components.unexplained(seen, (verdict for rule in RULES for verdict in rule.judge(seen)))
    for one in every:
        yield one if isinstance(one, Unknown) else replace(one, fixes=_in_units(seen, one.fixes))


def _in_units(seen: Observations, fixes: tuple[Fix, ...]) -> tuple[Fix, ...]:
    found: list[Fix] = []
    for fix in fixes:
        if isinstance(fix, Write):
            scale, unit = seen.units.get(fix.address, (1.0, ""))
            found.append(replace(fix, scale=scale, unit=unit, is_released=fix.address in seen.units))
        else:
            found.append(fix)
    return tuple(found)
