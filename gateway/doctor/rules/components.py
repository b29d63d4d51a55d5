"""Problems reported by the drivers of joints and sensors, unless another finding explains them."""

from collections.abc import Iterable, Iterator

from drivers.bus.nmt import HEARTBEAT
from gateway.config.robot import COMPONENT_TABLES, header
from gateway.doctor.observations import Observations
from gateway.doctor.verdicts import Advice, Finding, Run, Unknown, Verdict

_RESTART = Advice("start the gateway again while nobody is in the robot, so that it takes the file")
_COPY = Advice("where this is a copy of the robot's file, or an old one: take that which the gateway serves")
_CHANNEL = Advice("where it is another one: correct interface and channel in the robot's file")
_RESET = Advice("see that nobody is in danger, then gwrms reset; then start the controller")
_START = Advice("start the controller (a simulated robot's: gwrms sim-fault --dir DIR --controller start)")
_DESCRIBE = Advice("gwrms describe says since when, and what to check")


def component(seen: Observations) -> Iterator[Verdict]:
    """Every joint and sensor of which its driver says that something is wrong; the file that it goes by."""
    if seen.other_file is not None:
        words = "the gateway goes by another file than this one: joints and sensors are not judged"
        yield Finding("component", str(seen.config.path), words, (seen.other_file,), (_RESTART, _COPY))
    yield from _buses(seen)
    yield from _strangers(seen)
    yield from _held(seen)
    sampled = {name.partition(".")[0] for name in seen.samples.columns}
    for kind in COMPONENT_TABLES:
        for name in getattr(seen.config, kind):
            problem = seen.samples.problems.get(name)
            if problem is not None:
                words = "its driver says that something is wrong"
                yield Finding("component", header(kind, name), words, (problem,), (_DESCRIBE,))
            elif name not in sampled and kind != "device":  # a device has no channels
                yield Unknown("component", header(kind, name), seen.samples.why_none)


def _held(seen: Observations) -> Iterator[Verdict]:
    """Yield controllers that move nothing, although nothing else may be wrong any more."""
    for name, channel in seen.held.items():
        words = "it is held, as after a lost joint or a stop: it moves nothing until it is started again"
        why = () if seen.stop_held is None else (f"a stop is held: {seen.stop_held}",)
        fixes = (_START,) if seen.stop_held is None else (_RESET, _START)
        yield Finding("component", name, words, (f"{channel} = held", *why), fixes)


def _buses(seen: Observations) -> Iterator[Verdict]:
    """Buses on which nothing is heard, where their interface says why: it is not there, or down."""
    for name in seen.config.can:
        why, facts = seen.bus_obstacles.get(name), seen.buses.get(name)
        if why is None or "bit/s" in why or (facts is not None and not facts.is_silent):
            continue  # another bit rate is a finding of its own
        problem, _, command = why.partition("; run: ")
        fix = Run(command) if command else _CHANNEL
        words = "nothing can be heard on it: its interface is not there, or not as it must be"
        yield Finding("component", header("can", name), words, (problem,), (fix,))


def _strangers(seen: Observations) -> Iterator[Verdict]:
    """Yield nodes that no table has: a master's, perhaps, or a drive with another id than it should have."""
    for bus, settings in seen.config.can.items():
        known = {place.table.node_id for place in seen.nodes() if place.table.bus == bus}
        known |= {
            one.node_id for _, one in seen.config.on_buses() if one.bus == bus and hasattr(one, "node_id")
        }
        heard = {can_id - HEARTBEAT for can_id in seen.heard_on(bus) or ()} & set(range(1, 128))
        if others := sorted(heard - known - {settings.node_id}):
            nodes = ", ".join(map(str, others))
            why = f"node {nodes} is heard, and no table has it: gwrms scan says what it is"
            yield Unknown("component", header("can", bus), why)


def unexplained(seen: Observations, verdicts: Iterable[Verdict]) -> Iterator[Verdict]:
    """Without what a component says of a thing that another finding names better."""
    every = list(verdicts)
    named = {one.about for one in every if isinstance(one, Finding) and one.rule != "component"}
    for one in every:
        if not (isinstance(one, Finding) and one.rule == "component" and _is_named(seen, one.about, named)):
            yield one


def _is_named(seen: Observations, about: str, named: set[str]) -> bool:
    name = about.rpartition(".")[2].strip('"]')
    tables = (getattr(seen.config, kind).get(name) for kind in COMPONENT_TABLES)
    bus = next((header("can", table.bus) for table in tables if hasattr(table, "bus")), None)
    return bus in named or any(name in other for other in named)
