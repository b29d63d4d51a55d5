"""`gwrms describe`: what a robot is made of, and what is wrong with it."""

from collections.abc import Iterator

from gateway.cli.reach import parser, reach
from gateway.cli.text import NONE, exact, say, say_json, table
from gateway.messages import Description, ParameterInfo


def main(argv: list[str]) -> int:
    """Run `gwrms describe`."""
    arguments = parser(
        "describe",
        "What a robot is made of: its components and what is wrong with them, its channels and their units,\n"
        "its parameters and their limits, and what each drive does on a stop.",
    ).parse_args(argv)
    with reach(arguments, "describe") as robot:
        description = robot.describe()
    if arguments.json:
        say_json(description)
    else:
        say("\n".join(_chapters(description)))
    return 0


def _chapters(robot: Description) -> Iterator[str]:
    yield f"{robot.robot}: gateway as {robot.role}, boot {robot.boot_id}\n"
    yield table(
        ("COMPONENT", "KIND", "STATE", "PROBLEM"),
        [(part.name, part.kind, part.state, part.problem or "") for part in robot.components],
    )
    yield table(
        ("CHANNEL", "UNIT", "STATES"),
        [
            (channel.name, channel.unit, ", ".join((channel.enum or {}).values()))
            for channel in robot.channels
        ],
    )
    if robot.parameters:
        yield table(
            ("PARAMETER", "UNIT", "RANGE", "LARGEST STEP", "ACCESS", "OBJECT", "PROBLEM"),
            [_parameter(parameter) for parameter in robot.parameters],
            right=(3,),
        )
    yield _stop(robot)


def _parameter(info: ParameterInfo) -> tuple[str, ...]:
    bounds = f"{exact(info.min)} … {exact(info.max)}"
    step = exact(info.max_step)
    return (info.name, info.unit, bounds, step, info.access, info.object, info.problem or "")


def _stop(robot: Description) -> str:
    held = f"a stop is held: {robot.stop.reason}\n" if robot.stop.held else "no stop is held\n"
    if not robot.stop.drives:
        return held
    return held + table(
        ("DRIVE", "605Ah", "6007h", "STOPS IF THE GATEWAY DIES", "WARNING"),
        [
            (
                name,
                _option(drive.quick_stop_option),
                _option(drive.abort_connection_option),
                "yes" if drive.armed else "no",
                drive.warning or "",
            )
            for name, drive in robot.stop.drives.items()
        ],
    )


def _option(code: int | None) -> str:
    return NONE if code is None else str(code)
