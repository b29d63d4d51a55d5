"""The robot's file as a JSON Schema, from the structs that read it."""

from collections.abc import Collection, Iterator

from msgspec import Struct

from drivers.bus.interfaces.opening import interfaces
from drivers.bus.settings import CanSettings
from drivers.imu.canopen.cia410 import InclinometerSettings
from drivers.imu.settings import WIRINGS, CanImuSettings, ImuSettings
from drivers.insole.formats import FORMATS as INSOLE_FORMATS
from drivers.insole.settings import InsoleSettings
from gateway.config.guard import WATCHES, GuardSettings
from gateway.config.reading import NAMED, SINGLE
from gateway.tables.schema import Schema, definitions, document, named, ref

_IMUS: tuple[type[Struct], ...] = (ImuSettings, CanImuSettings, InclinometerSettings)


def schema() -> Schema:
    """Return all of it."""
    plain = {name: struct for name, struct in NAMED.items() if name != "imu"}
    defs = definitions([*SINGLE.values(), *plain.values(), *_IMUS, GuardSettings, *_rules()])
    for struct, formats in _formats():
        defs[struct.__name__]["properties"]["format"]["enum"] = list(formats)
    can = defs[CanSettings.__name__]
    del can["properties"]["more"]
    can["additionalProperties"] = True  # python-can's own
    can["properties"]["interface"] |= {"anyOf": [{"enum": list(interfaces())}, {"type": "string"}]}
    _tell_rules(defs)
    properties = {name: ref(struct) for name, struct in SINGLE.items()}
    properties |= {name: named(ref(struct)) for name, struct in plain.items()}
    properties["imu"] = named({"anyOf": [ref(one) for one in _IMUS]})
    properties["guard"] = ref(GuardSettings)
    return document("robot.toml", properties, ["robot"], defs)


def guard() -> tuple[Schema, dict[str, Schema]]:
    """`[guard]` alone, and the definitions that it refers to."""
    defs = definitions([GuardSettings, *_rules()])
    _tell_rules(defs)
    return ref(GuardSettings), defs


def _tell_rules(defs: dict[str, Schema]) -> None:
    """Add to the schema the quantities that each kind of rule can watch."""
    for struct in _rules():
        watched = [name for name, watch in WATCHES.items() if watch.rule is struct]
        defs[struct.__name__]["properties"]["watch"]["enum"] = watched
    defs[GuardSettings.__name__]["properties"]["rule"] = named({"anyOf": [ref(one) for one in _rules()]})


def _rules() -> list[type[Struct]]:
    return list(dict.fromkeys(watch.rule for watch in WATCHES.values()))


def _formats() -> Iterator[tuple[type[Struct], Collection[str]]]:
    yield InsoleSettings, INSOLE_FORMATS
    yield from zip(_IMUS, (wiring.formats for wiring in WIRINGS), strict=True)
