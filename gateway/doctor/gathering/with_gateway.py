"""A running robot: its gateway is asked for objects and channels, and its buses are listened to beside it."""

import contextlib
import time
from collections.abc import Iterable, Iterator, Mapping

from drivers.bus.interfaces.controller_state import BusState
from eds import Description
from gateway.client import ClientError, Robot
from gateway.client.held_controllers import held_channels, holding_channels
from gateway.doctor.gathering.objects import wanted
from gateway.doctor.observations import BusFacts, Object, Place, Samples, Value
from gateway.wire.bus import CLOSED, Buses
from gateway.wire.dictionary import ObjectValue
from gateway.wire.limits import OBJECTS_READ
from gateway.wire.robot import Description as Robots

RATE_HZ = 50.0
SETTLE_S = 2.0  # until every component has said something
IDLE_S = 1.0
ABORTED = "abort"  # in the words for an object that the device does not have
CHANNELS = ("position", "velocity", "force", "acceleration_x", "acceleration_y", "acceleration_z")


def transfers(buses: Buses) -> dict[str, dict[int, int]]:
    """SDO transfers that the gateway has begun, by bus and node."""
    return {bus.name: {node.node_id: node.sdo_transfers for node in bus.nodes} for bus in buses.buses}


def begun_between(before: Buses, after: Buses) -> dict[str, dict[int, int]]:
    """Return those that it began meanwhile."""
    old = transfers(before)
    return {
        bus: {node: count - old.get(bus, {}).get(node, 0) for node, count in nodes.items()}
        for bus, nodes in transfers(after).items()
    }


def by_figures(before: Buses, after: Buses) -> dict[str, BusFacts]:
    """Return the facts that a remote gateway has about its buses: no identifiers."""
    seconds = max((after.stamp_ns - before.stamp_ns) / 1e9, 0.1)
    old = {bus.name: bus.error_frames for bus in before.buses}
    return {
        bus.name: BusFacts(
            seconds,
            None,
            bus.frames_per_s,
            bus.load_percent,
            max(0, bus.error_frames - old.get(bus.name, 0)) / seconds,
            _state(bus.state),
            bus.problem,
        )
        for bus in after.buses
    }


def _state(words: str) -> BusState:
    name = words.rpartition(" ")[2].upper()
    return BusState.ACTIVE if words == CLOSED or name not in BusState.__members__ else BusState[name]


def samples(robot: Robot, described: Robots, seconds: float) -> Samples:
    """Take so many seconds of what motion is judged by; a second or two before are left out."""
    names = [one.name for one in described.channels if one.quantity in CHANNELS]
    if not names:
        return Samples(why_none="the robot has no joint, insole or IMU that could be sampled")
    stamps: list[int] = []
    columns: dict[str, list[float | None]] = {name: [] for name in names}
    began = time.monotonic()
    for batch in robot.watch(*names, rate_hz=RATE_HZ, idle_s=IDLE_S):
        if time.monotonic() - began > SETTLE_S:
            stamps += batch.stamps_ns
            for name in names:
                columns[name] += batch.columns.get(name, [None] * len(batch.stamps_ns))
        if time.monotonic() - began > SETTLE_S + seconds:
            break
    quality = robot.components(*names).quality
    problems = {name: str(one["problem"]) for name, one in quality.items() if one.get("problem")}
    period_s = (stamps[-1] - stamps[0]) / 1e9 / (len(stamps) - 1) if len(stamps) > 1 else 1 / RATE_HZ
    return Samples(
        period_s,
        {name: tuple(column) for name, column in columns.items()},
        "the gateway sent no samples",
        problems,
    )


def held(robot: Robot) -> tuple[dict[str, str], str | None]:
    """Return the controllers that are held now, by the state that says so; and why a stop is held."""
    described = robot.describe()
    names = holding_channels(described)
    values = robot.components(*names).values if names else {}
    found = {name.partition(".")[0]: name for name in held_channels(described, values)}
    return found, (described.stop.reason or "no reason given") if described.stop.held else None


def objects(
    robot: Robot, places: Iterable[Place], descriptions: Mapping[str, Description]
) -> dict[str, dict[Object, Value]]:
    """Return the values of each device; devices without answer or EDS are left out."""
    found = {}
    for place in places:
        description = descriptions.get(place.name)
        if description is None:
            continue
        held = _held(robot, place.name, [one for one in wanted(place, description) if description.has(*one)])
        if any(value is not None for value in held.values()):
            found[place.name] = held
    return found


def _held(robot: Robot, component: str, asked: list[Object]) -> dict[Object, Value]:
    held: dict[Object, Value] = {}
    with contextlib.suppress(ClientError):  # what it has told so far is true
        for start in range(0, len(asked), OBJECTS_READ):
            addresses = {f"0x{index:04X}:{sub}": (index, sub) for index, sub in asked[start:][:OBJECTS_READ]}
            values = robot.read_objects(component, *addresses).values
            held |= {addresses[name]: number for name, one in values.items() for number in _number(one)}
    return held


def _number(told: ObjectValue) -> Iterator[Value]:
    """Yield the value; `None` if the device lacks the object, and nothing if the value is unknown."""
    if isinstance(told.value, int | float):
        yield told.value
    elif told.value is None and ABORTED in (told.problem or ""):
        yield None
