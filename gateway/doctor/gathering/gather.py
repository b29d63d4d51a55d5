"""A robot looked at once: its file, its computer, then for some seconds its buses, devices and sensors."""

import contextlib
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import eds
from drivers.bus.interfaces.opening import obstacle
from drivers.scan.identification import NodeAnswers
from drivers.scan.products import Library, files
from eds.shipped import SHIPPED
from gateway.client import Address, ClientError, LinkSettings, Robot, Unreachable
from gateway.config.robot import RobotConfig
from gateway.doctor.gathering import with_gateway, without_gateway
from gateway.doctor.gathering.computer import ROOT, computer
from gateway.doctor.gathering.listening import Listening, Wait
from gateway.doctor.observations import BusFacts, Computer, NodeTable, Object, Observations, Samples, Value
from gateway.wire.robot import Description as Robots

NOT_ACTIVE = "devices are asked only through a gateway, or with --active"
NOT_HERE = "it was asked, and did not answer"
OTHER = "the gateway goes by another file than this one"


@dataclass(frozen=True, slots=True)
class How:
    """Options of the observation: duration, gateway, and what may be sent without one."""

    seconds: float = 20.0
    gateway: Address | None = None  # None: nobody is asked
    active: bool = False
    here: bool = True  # whether this is the robot's computer
    root: Path = ROOT
    folders: tuple[Path, ...] = ()  # of EDS files
    say: Callable[[str], object] = lambda _: None


@dataclass(frozen=True, slots=True)
class _Seen:
    buses: Mapping[str, BusFacts]
    objects: Mapping[str, Mapping[Object, Value]]
    samples: Samples
    why_no_objects: str
    units: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    other_file: str | None = None
    held: Mapping[str, str] = field(default_factory=dict)
    stop_held: str | None = None


class OtherRobot(ClientError):
    """The gateway that answers is that of another robot than the file's."""


def gather(config: RobotConfig, how: How) -> Observations:
    """Everything that the doctor goes by; what could not be seen is not there, and says why.

    Raises:
        ClientError: the gateway cannot be asked, or is another robot's.

    """
    descriptions = dict(_descriptions(config))
    empty = Observations(config, descriptions, {}, {}, Samples(), Computer())
    with _gateway(how) as robot:
        seen = _silent(empty, how) if robot is None else _running(empty, how, robot)
    return replace(
        empty,
        buses=seen.buses,
        objects=seen.objects,
        samples=seen.samples,
        computer=computer(config, how.root) if how.here else Computer(),
        proposals=dict(_proposals(empty, seen.objects, how.folders)),
        why_no_objects=seen.why_no_objects,
        bus_obstacles=dict(_obstacles(config)) if how.here else {},
        units=seen.units,
        other_file=seen.other_file,
        held=seen.held,
        stop_held=seen.stop_held,
    )


@contextlib.contextmanager
def _gateway(how: How) -> Iterator[Robot | None]:
    """Return the robot's gateway, where one runs."""
    if how.gateway is None:
        yield None
        return
    try:
        robot = Robot(how.gateway, LinkSettings(client="gwrms doctor"))
    except Unreachable:
        if not how.here:
            raise
        how.say(f"no gateway answers at {how.gateway}: the robot is looked at as a silent one\n")
        yield None
        return
    with robot:
        how.say(f"the gateway at {how.gateway} is asked, for {how.seconds:g} s; best while the robot walks\n")
        yield robot


def _descriptions(config: RobotConfig) -> Iterator[tuple[str, eds.Description]]:
    tables: dict[str, NodeTable] = {**config.joint, **config.device}
    for name, table in tables.items():
        with contextlib.suppress(eds.EdsError, OSError):
            yield name, eds.load(eds.locate(table.eds, config.path), table.node_id)


def _obstacles(config: RobotConfig) -> Iterator[tuple[str, str]]:
    for name, settings in config.can.items():
        if (why := obstacle(settings)) is not None:
            yield name, why


def _running(empty: Observations, how: How, robot: Robot) -> _Seen:
    described = robot.describe()
    _check_robot(empty.config, described, how)
    other_file = _other_file(empty.config, described)
    ears = empty.config.can if how.here else {}
    with Listening(ears, _waiting()) as listening:
        before = robot.buses()
        samples = (
            with_gateway.samples(robot, described, how.seconds)
            if other_file is None
            else Samples(why_none=OTHER)
        )
        if not samples.columns:
            _waiting()(how.seconds)
        after = robot.buses()
        buses = with_gateway.by_figures(before, after)
        facts = listening.facts(with_gateway.begun_between(before, after))
        buses |= {name: one for name, one in facts.items() if one.heard is not None}
    if other_file is not None:
        return _Seen(buses, {}, samples, OTHER, other_file=other_file)
    objects = with_gateway.objects(robot, empty.nodes(), empty.descriptions)
    units = {f"{one.component}.{one.object}": (one.scale, one.unit) for one in described.parameters}
    held, why = with_gateway.held(robot)
    return _Seen(buses, objects, samples, NOT_HERE, units, held=held, stop_held=why)


def _check_robot(config: RobotConfig, described: Robots, how: How) -> None:
    if described.robot != config.robot.name:
        raise OtherRobot(
            f"the gateway at {how.gateway} is that of {described.robot}, and {config.path} is of "
            f"{config.robot.name}: name its own (--robot HOST:PORT), or none (--silent)"
        )


def _other_file(config: RobotConfig, described: Robots) -> str | None:
    """Return why this file does not judge what the gateway tells; older gateways do not say."""
    if described.file in (None, config.digest):
        return None
    return f"it read {described.file[:8] if described.file else '–'}…, this file is {config.digest[:8]}…"


def _silent(empty: Observations, how: How) -> _Seen:
    config, wait = empty.config, _waiting()
    with Listening(config.can, wait) as listening:
        samples = without_gateway.samples(config, how.seconds, wait, active=False)
        if not samples.columns:
            wait(how.seconds)
        buses = listening.facts({})
        asked = {name: listening.asked(name) for name in config.can}
    if not how.active:
        return _Seen(buses, {}, samples, NOT_ACTIVE)
    objects = without_gateway.objects(config, empty.nodes(), empty.descriptions, asked, wait)
    return _Seen(buses, objects, without_gateway.samples(config, how.seconds, wait, active=True), NOT_HERE)


def _waiting() -> Wait:
    return threading.Event().wait


def _proposals(
    seen: Observations, objects: Mapping[str, Mapping[Object, Value]], folders: tuple[Path, ...]
) -> Iterator[tuple[str, str]]:
    """Yield the EDS file for what each device says it is, where its own is another's."""
    library: Library | None = None
    for place in seen.nodes():
        vendor, product = (objects.get(place.name, {}).get((0x1018, sub)) for sub in (1, 2))
        own = seen.descriptions.get(place.name)
        if (
            vendor is None
            or product is None
            or (own and (own.vendor_id, own.product_code) == (vendor, product))
        ):
            continue
        library = library or Library(files(folders))
        for fits in library.proposals(place.table.node_id, _told(int(vendor), int(product)))[:1]:
            path = fits.description.path
            yield place.name, path.name if path.parent == SHIPPED else str(path)


def _told(vendor: int, product: int) -> NodeAnswers:
    """Return a device of which only that is known."""
    return NodeAnswers(0, None, None, None, None, vendor, product, None, None, None, (), ())
