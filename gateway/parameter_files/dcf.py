"""One device's parameters as a DCF (CiA 306): the numbers that the device itself holds, by object."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path

import eds
from eds import Description, dcf
from eds.datatypes import DATA_TYPE_BY_NAME
from gateway.coding import Coding, Number, scaled
from gateway.parameter_files.contents import (
    FileProblem,
    Saved,
    Scope,
    WhichDevice,
    device,
    is_configuration,
    is_meant,
)
from gateway.wire.component import ComponentInfo
from gateway.wire.parameter import ParameterInfo


def chosen(scope: Scope, globs: Sequence[str]) -> list[ParameterInfo]:
    """Return the device's parameters that the globs select.

    Without any, all that can be configured there, by whomever.
    """
    infos = _of_node(scope, _named(scope, scope.component)).values()
    return [info for info in infos if is_configuration(info) and (not globs or is_meant(info, globs))]


def write(path: Path, scope: Scope, values: Mapping[str, Number]) -> bytes:
    """Return the file's content, made from the device's EDS; raises `FileProblem` or `EdsError`."""
    component = _named(scope, scope.component)
    about = device(component)
    file = scope.eds or eds.locate(str(about["eds"]), path)
    node_id, bitrate = int(about["node_id"]), about.get("bitrate")
    _check_device(file, eds.load(file, node_id), component)
    infos = _of_node(scope, component)
    raw = {key: _raw(info, values[info.name]) for key, info in infos.items() if info.name in values}
    node = dcf.Commissioning(
        node_id, component.name, str(about["bus"]), None if bitrate is None else int(bitrate)
    )
    return dcf.configured(file.read_bytes(), file.name, path.name, node, raw, datetime.now().astimezone())


def read(path: Path, scope: Scope) -> Saved:
    """Read the values for the device that the file is for, or that `--component` names.

    Raises:
        FileProblem, EdsError: it cannot be read, or is another device's.

    """
    node_id, node_name = dcf.owner(path)
    component = _named(scope, scope.component or _guess(scope, node_id, node_name))
    found = dcf.read(path, int(device(component)["node_id"]))
    _check_device(path, found.description, component)
    infos = _of_node(scope, component)
    values = dict(_in_units(component.name, infos.get(key), key, one) for key, one in found.values.items())
    other = node_name not in ("", component.name)
    return Saved(values, (f"it was saved from {node_name}, this is {component.name}",) if other else ())


def _named(scope: Scope, name: str | None) -> ComponentInfo:
    devices = {one.name: one for one in scope.robot.components if "eds" in device(one)}
    if name not in devices:
        said = "a DCF is for one device" if name is None else f"there is no CANopen device {name!r}"
        raise WhichDevice(f"{said}; give --component, one of {', '.join(devices) or 'none'}")
    return devices[name]


def _guess(scope: Scope, node_id: int | None, node_name: str) -> str | None:
    """Return the device of that name, else the only one of that node id."""
    names = [one.name for one in scope.robot.components if "eds" in device(one)]
    if node_name in names:
        return node_name
    same = [one.name for one in scope.robot.components if device(one).get("node_id", 0) == node_id]
    return same[0] if len(same) == 1 else None


def _of_node(scope: Scope, component: ComponentInfo) -> dict[dcf.Key, ParameterInfo]:
    """Return the parameters of a device, of all its axes, by object."""
    place = _place(component)
    sharing = {one.name for one in scope.robot.components if _place(one) == place}
    infos = (info for info in scope.robot.parameters if info.component in sharing and info.type)
    return {_key(info): info for info in infos}


def _place(component: ComponentInfo) -> tuple[object, object]:
    about = device(component)
    return about.get("bus"), about.get("node_id")


def _key(info: ParameterInfo) -> dcf.Key:
    index, _, subindex = info.object.partition(":")
    return int(index, 16), int(subindex)


def _raw(info: ParameterInfo, value: Number) -> Number:
    """Return the device's own number."""
    data_type = DATA_TYPE_BY_NAME[info.type]
    return Coding(data_type).decode(Coding(data_type, info.scale).encode(value))


def _in_units(component: str, info: ParameterInfo | None, key: dcf.Key, number: Number) -> tuple[str, Number]:
    """Return the robot's name and value of it; its address and number, where the robot does not have it."""
    if info is None:
        return f"{component}.0x{key[0]:04X}:{key[1]}", number
    return info.name, scaled(number, info.scale)


def _check_device(path: Path, description: Description, component: ComponentInfo) -> None:
    about = device(component)
    for key, found in (("vendor", description.vendor), ("product", description.product)):
        expected = about.get(key)
        if expected and found != expected:
            raise FileProblem(
                f"{path} is for another device: its {key} is {found!r}, {component.name}'s is {expected!r}"
            )
