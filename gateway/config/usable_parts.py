"""The usable parts of a file with mistakes, so that the rest is checked in the same run."""

from collections.abc import Iterable
from typing import Any

from msgspec import structs

from gateway.config.robot import RobotConfig, header
from gateway.tables.finding import Finding

_TABLES = ("can", "joint", "device", "insole", "imu", "parameter", "channel")


def remains(config: RobotConfig, mistakes: Iterable[Finding]) -> RobotConfig:
    """Return the same robot without the tables that mistakes were found in, and without what needs those."""
    wrong = {one.where.lstrip("[").partition("]")[0] for one in mistakes}
    kept: dict[str, Any] = {table: _right(config, table, wrong) for table in _TABLES}
    for table in ("joint", "device", "imu"):
        kept[table] = {
            name: one
            for name, one in kept[table].items()
            if getattr(one, "bus", None) in {None, *kept["can"]}
        }
    for table in ("parameter", "channel"):
        owners = {*kept["joint"], *kept["device"]}
        kept[table] = {name: one for name, one in kept[table].items() if name.partition(".")[0] in owners}
    told = [one for one in config.stop.controller if one.component in kept["device"]]
    sound = "stop" not in wrong and "stop.controller" not in wrong
    stop = structs.replace(config.stop, controller=tuple(told if sound else ()))
    return structs.replace(config, **kept, stop=stop, guard=None, control_loop=None)


def _right(config: RobotConfig, table: str, wrong: set[str]) -> dict[str, Any]:
    """Return the tables of a kind without mistakes, in nested tables too."""
    names = {name: header(table, name).strip("[]") for name in getattr(config, table)}
    return {
        name: getattr(config, table)[name]
        for name, written in names.items()
        if not any(one == written or one.startswith(f"{written}.") for one in wrong)
    }
