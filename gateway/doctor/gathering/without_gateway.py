"""A robot without a running gateway. Sensors are read here; devices are asked only where that is allowed.

Our own drivers do it, as an observer's: none of them is let configure a PDO, and nothing is enabled.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack

from msgspec.structs import replace

from drivers.bus.bus import CanBus
from drivers.bus.outlet import Requests
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.settings import Role
from drivers.bus.values import unsigned
from drivers.component import Component, ComponentKind
from drivers.errors import DeviceAbort, DriverError
from drivers.imu.settings import NodeImuSettings
from drivers.scan.identification import TIMEOUT_S
from eds import Description
from gateway.config.robot import RobotConfig
from gateway.doctor.gathering.objects import wanted
from gateway.doctor.gathering.with_gateway import CHANNELS
from gateway.doctor.observations import Object, Place, Samples, Value
from gateway.modules.component.assembly import assemble

PERIOD_S = 0.02
SETTLE_S = 3.0
WHY_NONE = "a silent robot's joints are asked only with --active"

Wait = Callable[[float], object]


def harmless(config: RobotConfig) -> RobotConfig:
    """Return the same robot for drivers that change nothing on it."""
    joints = {name: replace(joint, configure_pdos=False) for name, joint in config.joint.items()}
    gateway = replace(config.gateway, role=Role.OBSERVER)
    return replace(config, gateway=gateway, joint=joints, guard=None)


def samples(config: RobotConfig, seconds: float, wait: Wait, *, active: bool) -> Samples:
    """Take so many seconds of sensors and, if `active`, of joints."""
    robot = assemble(harmless(config))
    chosen = [one for one in robot.components.values() if active or _only_listens(config, one)]
    if not chosen:
        return Samples(why_none=WHY_NONE)
    with ExitStack() as ending:
        for bus in robot.buses.values() if active else ():
            ending.callback(bus.stop)
            bus.start()
        for component in chosen:
            ending.callback(component.stop)
            component.start()
        wait(SETTLE_S)
        columns = _columns(chosen, seconds, wait)
        now_ns = time.monotonic_ns()
        problems = {
            one.name: problem for one in chosen if (problem := one.quality(now_ns).problem) is not None
        }
    return Samples(PERIOD_S, columns, WHY_NONE, problems)


def _only_listens(config: RobotConfig, component: Component) -> bool:
    imu = config.imu.get(component.name)
    return component.kind is ComponentKind.INSOLE or (
        imu is not None and not isinstance(imu, NodeImuSettings)
    )


def _columns(chosen: list[Component], seconds: float, wait: Wait) -> dict[str, tuple[float | None, ...]]:
    channels = [
        (one.latest, index, channel.name)
        for one in chosen
        for index, channel in enumerate(one.channels)
        if channel.quantity in CHANNELS
    ]
    columns: dict[str, list[float | None]] = {name: [] for _, _, name in channels}
    began = time.monotonic()
    for row in range(round(seconds / PERIOD_S)):
        wait(max(0.0, began + row * PERIOD_S - time.monotonic()))
        now_ns = time.monotonic_ns()
        for latest, index, name in channels:
            columns[name].append(latest.read(index, now_ns)[0])
    return {name: tuple(column) for name, column in columns.items()}


def objects(
    config: RobotConfig,
    places: Iterable[Place],
    descriptions: Mapping[str, Description],
    asked_by_others: Mapping[str, frozenset[int]],
    wait: Wait,
) -> dict[str, dict[Object, Value]]:
    """Return the values of each device that nobody else asks; devices without answer are left out."""
    found: dict[str, dict[Object, Value]] = {}
    with ExitStack() as ending:
        buses = {name: CanBus(name, settings) for name, settings in config.can.items()}
        for bus in buses.values():
            ending.callback(bus.stop)
            bus.start()
        wait(SETTLE_S / 2)
        for place in places:
            bus, node = buses[place.table.bus], place.table.node_id
            if bus.is_open and node not in asked_by_others.get(place.table.bus, ()):
                held = dict(_held(bus, place, descriptions.get(place.name)))
                found |= {place.name: held} if held else {}
    return found


def _held(bus: CanBus, place: Place, description: Description | None) -> Iterator[tuple[Object, Value]]:
    request, response = place.table.sdo_ids(place.table.node_id)
    channel = SdoChannel(place.name, Requests(bus, request), TIMEOUT_S)
    bus.subscribe(response, channel.on_response)
    try:
        for index, subindex in wanted(place, description):
            try:
                yield (index, subindex), unsigned(channel.upload(index, subindex))
            except DeviceAbort:
                yield (index, subindex), None
    except DriverError:
        return  # what it has told so far is true
    finally:
        bus.unsubscribe(response, channel.on_response)
