"""`gwrms get`: parameters, as the devices have them now."""

from msgspec import UNSET

from gateway.cli.connect import check_names, connect, parameter_names, parser, widened
from gateway.cli.text import exact, say, say_json, table
from gateway.cli.value_display import add_degrees, unit_of
from gateway.units import Unit
from gateway.wire.parameter import ParameterInfo, ParameterValue

EPILOG = """examples:
  gwrms get gait                      all of a component
  gwrms get 'left_knee.*'            with parameters = "eds" all that its EDS lets write, and its texts
  gwrms get left_knee.0x6072:0       by its address in the device"""


def main(argv: list[str]) -> int:
    """Run `gwrms get`."""
    made = parser("get", "Read parameters from the devices.", EPILOG)
    made.add_argument(
        "names",
        metavar="GLOB",
        nargs="*",
        help="names, addresses, globs, or a component (default: all writable ones)",
    )
    add_degrees(made)
    arguments = made.parse_args(argv)
    with connect(arguments, "get") as robot:
        description = robot.describe()
        names = widened(arguments.names, description)
        check_names("parameter", names, parameter_names(description))
        values = robot.read(*names).values
    if arguments.json:
        say_json({"values": values})
    else:
        infos = {info.name: info for info in description.parameters}
        rows = [
            _row(infos[name], value, unit_of(value.unit, degrees=arguments.deg))
            for name, value in values.items()
        ]
        say(table(("PARAMETER", "VALUE", "UNIT", "RANGE", ""), rows, right=(1,)))
    return 1 if any(one.value is None and one.text is UNSET for one in values.values()) else 0


def _row(info: ParameterInfo, value: ParameterValue, unit: Unit) -> tuple[str, ...]:
    read_only = f"read-only: {info.read_only}" if info.read_only else ""
    held, low, high = (_text(number, unit) for number in (value.value, value.min, value.max))
    if isinstance(value.text, str):
        return info.name, value.text, "", "", value.problem or ""
    return info.name, held, unit.symbol, f"{low} … {high}", value.problem or read_only


def _text(value: float | None, unit: Unit) -> str:
    """Return a value with every digit that it has; in another unit, with those that are worth reading."""
    return exact(value) if value is None or unit.symbol == unit.si else f"{value * unit.scale:.6g}"
