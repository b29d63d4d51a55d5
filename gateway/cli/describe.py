"""`gwrms describe`: list a robot's components and problems."""

import re
import textwrap
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping

import msgspec

from gateway.amounts import NONE
from gateway.cli import describe_buses
from gateway.cli.connect import connect, parser
from gateway.cli.describe_problems import summary
from gateway.cli.text import PAGE, budget, exact, say, say_json, table
from gateway.client.blocking import Robot
from gateway.client.held_controllers import HELD, held_channels, holding_channels
from gateway.wire.bus import CLOSED
from gateway.wire.component import ChannelInfo, ComponentInfo
from gateway.wire.parameter import ParameterInfo
from gateway.wire.robot import Description, GuardInfo, GuardRuleInfo, Hello
from gateway.wire.stop import StopInfo

LOAD_S, LOOK_S = 2.0, 0.2  # how long a bus that has just been opened is given, and how often it is looked


def main(argv: list[str]) -> int:
    """Run `gwrms describe`."""
    arguments = parser(
        "describe",
        "Show a robot's components and buses with their problems, since when and what\n"
        "to check, its channels and their units, its parameters and their limits, and what each drive does\n"
        "on a stop. The last line counts the problems and names their places.",
    ).parse_args(argv)
    with connect(arguments, "describe") as robot:
        description, hello = _measured(robot), robot.hello
        names = holding_channels(description)
        values = robot.components(*names).values if names else {}
    controllers = list(held_channels(description, values))
    if arguments.json:
        say_json(msgspec.to_builtins(description) | {"controllers_held": controllers})
    else:
        chapters = [*_you(hello), *held(description, values), *_chapters(description)]
        say("\n".join([*chapters, summary(description, controllers)]))
    return 0


def _measured(robot: Robot) -> Description:
    """Return its description; where nobody had the buses open before, as soon as their load was measured."""
    deadline_s = time.monotonic() + LOAD_S
    while True:
        description = robot.describe()
        known = [bus.frames_per_s is not None or bus.state == CLOSED for bus in description.buses]
        if all(known) or time.monotonic() > deadline_s:
            return description
        time.sleep(LOOK_S)


def _you(hello: Hello | None) -> Iterator[str]:
    """Yield the client's identity, and its forbidden methods."""
    if hello is not None:
        not_for_you = f"; not for you: {', '.join(hello.refused)}" if hello.refused else ""
        yield textwrap.fill(f"you are {hello.who}{not_for_you}", PAGE, subsequent_indent="  ") + "\n"


def held(robot: Description, values: Mapping[str, float | None]) -> Iterator[str]:
    """Tell of controllers whose own state is `held`: they move nothing until somebody starts them."""
    for name in held_channels(robot, values):
        yield (
            f"{name} is {HELD}, as after a lost joint: it moves nothing until it is started again\n"
            "(a simulated robot's: gwrms sim-fault --dir DIR --controller start)\n"
        )


def _chapters(robot: Description) -> Iterator[str]:
    software = f"gwrms {robot.version}, " if robot.version else ""
    yield f"{robot.robot}: gateway as {robot.role}, {software}boot {robot.boot_id}\n"
    yield table(
        ("COMPONENT", "KIND", "STATE", "PROBLEM"),
        [(part.name, part.kind, part.state, part.problem or "") for part in robot.components],
    )
    yield from _profiles(robot.components)
    yield from describe_buses.chapters(robot)
    yield _channels(robot.channels)
    if robot.parameters:
        yield table(
            ("PARAMETER", "UNIT", "RANGE", "LARGEST STEP", "ACCESS", "OBJECT", "PROBLEM"),
            [_parameter(parameter) for parameter in robot.parameters if parameter.read_only is None],
            right=(3,),
        ) + "".join(_read_only(robot.parameters))
    yield _stop(robot)
    if robot.guard.configured:
        yield _guard(robot.guard)
    if robot.budget is not None:
        yield f"BUDGET  {budget(robot.budget)}\n"


def _profiles(components: list[ComponentInfo]) -> Iterator[str]:
    """Yield the components with a product profile, and its name."""
    known: dict[str, list[str]] = {}
    for part in components:
        profile = part.device.get("profile") if isinstance(part.device, dict) else None
        if profile is not None:
            known.setdefault(str(profile), []).append(part.name)
    if known:
        yield "PROFILES (known beside their EDS)\n" + _wrapped(known.items())


def _channels(channels: list[ChannelInfo]) -> str:
    """Return the channels by component, numbered ones as one, and once for each state what it can be."""
    by_component: dict[str, dict[str, str]] = {}
    for channel in channels:
        quantity, unit = (
            re.sub(r"_\d+$", "_*", channel.quantity),
            f" [{channel.unit}]" if channel.unit else "",
        )
        by_component.setdefault(channel.component, {})[quantity] = quantity + unit
    words = {channel.quantity: list(channel.enum.values()) for channel in channels if channel.enum}
    rows = [(name, quantities.values()) for name, quantities in by_component.items()]
    return "CHANNELS (component.quantity)\n" + _wrapped(rows) + "\nSTATES\n" + _wrapped(words.items())


def _wrapped(rows: Iterable[tuple[str, Iterable[str]]]) -> str:
    lines = [(name, ", ".join(words)) for name, words in rows]
    width = max((len(name) for name, _ in lines), default=0) + 2
    return "".join(
        textwrap.fill(text, PAGE, initial_indent=name.ljust(width), subsequent_indent=" " * width) + "\n"
        for name, text in lines
    )


def _parameter(info: ParameterInfo) -> tuple[str, ...]:
    bounds = f"{exact(info.min)} … {exact(info.max)}"
    step = exact(info.max_step)
    return (info.name, info.unit, bounds, step, info.access, info.object, info.problem or "")


def _read_only(parameters: list[ParameterInfo]) -> Iterator[str]:
    """Yield the numbers of further parameters, which can only be read."""
    more = Counter(parameter.component for parameter in parameters if parameter.read_only is not None)
    for component, count in more.items():
        yield f"{component}: {count} more, read-only (gwrms get '{component}.*')\n"


def _stop(robot: Description) -> str:
    if not robot.stop.drives:
        return _stop_beyond(robot.stop)
    return _stop_beyond(robot.stop) + table(
        ("DRIVE", "ON QUICK STOP (605Ah)", "ON LOST COMMUNICATION (6007h)", "ARMED"),
        [
            (
                name,
                _option(drive.quick_stop_option, drive.quick_stop),
                _option(drive.abort_connection_option, drive.abort_connection),
                "stops if the gateway dies" if drive.armed else robot.guard.arming.get(name, "no"),
            )
            for name, drive in robot.stop.drives.items()
        ],
    )


def _stop_beyond(stop: StopInfo) -> str:
    """Return whether one is held, and what it does beside the drives' quick stop, in words."""
    why = f"reason: {stop.reason or 'none given'}"
    lines = [f"a stop is held ({why}); gwrms reset ends it" if stop.held else "no stop is held"]
    lines += [] if stop.problem is None else [stop.problem]
    for name, why_not in stop.controllers.items():
        what = f"a stop also stops the controller {name}"
        lines.append(what if why_not is None else f"a stop CANNOT stop the controller {name}: {why_not}")
    again = {name: times for name, times in stop.stopped_again.items() if times}
    lines += [
        f"{name} was enabled {times} times meanwhile, and stopped again" for name, times in again.items()
    ]
    lines += [f"where a quick stop is not confirmed: {fallback}" for fallback in stop.fallbacks]
    return "".join(f"{line}\n" for line in lines)


def _guard(guard: GuardInfo) -> str:
    if guard.problem is not None:
        return f"the guard does not run: {guard.problem}\n"
    return table(
        ("GUARD RULE", "WATCHES", "TRIPS", "ACTIONS", "STATE", "REASON"),
        [_rule(rule) for rule in guard.rules],
    )


def _rule(rule: GuardRuleInfo) -> tuple[str, ...]:
    actions = ", ".join(action.replace("_", " ") for action in rule.actions)
    more = len(rule.problems) - (rule.state == "blind")
    unseen = f" ({more} more that it cannot see)" if more > 0 else ""
    return (rule.name, rule.watch, rule.limit, actions, rule.state, f"{rule.reason or ''}{unseen}")


def _option(code: int | None, words: str | None) -> str:
    return NONE if code is None else f"{code}: {words or 'not known'}"
