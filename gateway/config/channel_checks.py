"""Mistakes and unlikely values in `[channel."component.name"]`."""

from collections.abc import Iterator

from drivers.bus.settings import ChannelSettings
from drivers.joint.quantities import OWN
from gateway.config.robot import NAME, RobotConfig, header
from gateway.tables.finding import Finding, meant, warning
from gateway.units import ALIASES, UNITS

_FURTHER = ("V", "W", "Hz", "kg", "m/s", "rad/s²", "N/m", "N·m/rad", "J", "K", "Ω", "F", "H", "T", "lx")
# Of a joint: guard, window and driver go by these names and take the numbers for what the names say.
_JOINTS_UNITS = {"temperature": "°C", "voltage": "V", "digital_inputs": ""}
SI = (*UNITS, *_FURTHER)
# Units that are none here: what they are in SI, and how much of it one is.
_OTHERS: dict[str, tuple[str, float]] = {
    **{unit.symbol: (si, 1.0 / unit.scale) for si, units in UNITS.items() for unit in units},
    "mV": ("V", 1e-3),
    "mN·m": ("N·m", 1e-3),
    "mrad": ("rad", 1e-3),
    "µm": ("m", 1e-6),
    "bar": ("Pa", 1e5),
    "kHz": ("Hz", 1e3),
    "min": ("s", 60.0),
}


def complaints(config: RobotConfig) -> Iterator[Finding]:
    """Everything of that kind."""
    for name, one in config.channel.items():
        where = header("channel", name)
        yield from _about_name(config, where, name)
        yield from _about_numbers(where, one)
        yield from _about_unit(where, one)
        yield from _about_meaning(config, where, name, one)
        yield from _about_words(where, one)
        yield from _about_rate(config, where, name, one)


def _about_name(config: RobotConfig, where: str, name: str) -> Iterator[Finding]:
    component, _, quantity = name.partition(".")
    owners = config.names("joint", "device")
    if not NAME.fullmatch(quantity):
        text = 'a channel is called "component.name", and a name is a letter, then letters, digits, _ and -'
        yield Finding(where, "", text)
    if component not in owners:
        known = ", ".join(owners) or "none"
        text = f"there is no joint or device {component!r}: {meant(component, owners)}here are {known}"
        yield Finding(where, "", text)
    if component in config.names("joint") and quantity in OWN:
        text = f"every joint has its own {quantity}: take another name, or leave the table out"
        yield Finding(where, "", text)


def _about_numbers(where: str, one: ChannelSettings) -> Iterator[Finding]:
    if one.address[1] > 0xFF:
        yield Finding(where, "object", "the subindex goes from 0 to 255")
    if one.scale == 0:
        yield Finding(where, "scale", "0 would make every value the same")


def _about_unit(where: str, one: ChannelSettings) -> Iterator[Finding]:
    if one.unit in SI:
        return
    symbol = ALIASES.get(one.unit, one.unit)
    si, factor = _OTHERS.get(symbol, (symbol, 1.0))
    if si not in SI:
        known = ", ".join(filter(None, SI))
        text = f'{one.unit!r} is no unit that is known here, so nothing converts it: {known}, or "" for none'
        yield warning(where, "unit", text)
    elif factor == 1.0:
        yield Finding(where, "unit", f'{one.unit!r} is written "{si}"')
    else:
        text = f'is SI: for {one.unit} write unit = "{si}" and scale = {one.scale * factor:.12g}'
        yield Finding(where, "unit", text)


def _about_meaning(config: RobotConfig, where: str, name: str, one: ChannelSettings) -> Iterator[Finding]:
    component, _, quantity = name.partition(".")
    unit = _JOINTS_UNITS.get(quantity) if component in config.joint else None
    if unit is None or one.unit == unit:
        return
    told = f"in {unit}" if unit else "a number without a unit"
    text = f'a joint\'s {quantity} is {told}: write unit = "{unit}" with its scale, or take another name'
    yield Finding(where, "unit", text)


def _about_words(where: str, one: ChannelSettings) -> Iterator[Finding]:
    wrong = next((number for number in one.words if not number.removeprefix("-").isdecimal()), None)
    if wrong is not None:
        text = f'{wrong!r} is no whole number: write words such as {{ 0 = "stance", 1 = "swing" }}'
        yield Finding(where, "words", text)
    if one.words and (one.unit or one.scale != 1 or one.offset):
        text = "are for the device's own numbers: leave out unit, scale and offset, or words"
        yield Finding(where, "words", text)


def _about_rate(config: RobotConfig, where: str, name: str, one: ChannelSettings) -> Iterator[Finding]:
    component = name.partition(".")[0]
    table = config.joint.get(component) or config.device.get(component)
    if table is None or not one.poll_hz:
        return
    if one.poll_hz * table.stale_after_s < 1:
        text = (
            f"{one.poll_hz:g} leaves a value absent between two answers, for it is stale after "
            f"{table.stale_after_s:g} s: write {2 / table.stale_after_s:g}, or a longer stale_after_s"
        )
        yield warning(where, "poll_hz", text)
