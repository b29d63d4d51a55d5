"""Which transport serves which interface name."""

from collections.abc import Callable

from drivers.bus.frames import Transport
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable


def _socketcand(settings: CanSettings) -> Transport:
    from drivers.bus.interfaces.socketcand import SocketcandTransport

    try:
        host, port = str(settings.more["host"]), int(settings.more["port"])
    except (KeyError, ValueError) as error:
        raise Unavailable("interface socketcand needs the keys host and port in its [can.…] table") from error
    return SocketcandTransport(host, port, str(settings.channel))


def _socketcan(settings: CanSettings) -> Transport:
    if settings.more:  # such as CAN FD: only python-can knows these keys
        return _python_can(settings)
    from drivers.bus.interfaces.socketcan import open_socketcan

    return open_socketcan(settings)


def _python_can(settings: CanSettings) -> Transport:
    from drivers.bus.interfaces.python_can import PythonCanTransport

    return PythonCanTransport(settings)


# Those of python-can 4; plug-ins may bring others.
_PYTHON_CAN = (
    "virtual",
    "slcan",
    "pcan",
    "kvaser",
    "ixxat",
    "gs_usb",
    "vector",
    "canalystii",
    "cantact",
    "etas",
    "iscan",
    "neousys",
    "neovi",
    "nican",
    "nixnet",
    "robotell",
    "seeedstudio",
    "serial",
    "systec",
    "udp_multicast",
    "usb2can",
)
_OWN: dict[str, Callable[[CanSettings], Transport]] = {
    "socketcand": _socketcand,
    "socketcan": _socketcan,
}


def needs_python_can(settings: CanSettings) -> bool:
    """Whether the interface is opened by python-can, and not by a transport of ours."""
    return settings.interface not in _OWN or (settings.interface == "socketcan" and bool(settings.more))


def open_transport(settings: CanSettings) -> Transport:
    """Open the interface that `settings` name; imports only what it needs. Raises `Unavailable`."""
    return _OWN.get(settings.interface, _python_can)(settings)


def interfaces() -> tuple[str, ...]:
    """Every name of an interface that comes with us."""
    return (*sorted(_OWN), *_PYTHON_CAN)


def is_interface(name: str) -> bool:
    """Whether there is such an interface: one that comes with us, or of a plug-in of python-can."""
    if name in interfaces():
        return True
    from importlib.metadata import entry_points  # for who has a plug-in, or has mistyped, only

    return bool(entry_points(group="can.interface", name=name))
