"""Choice of the transport by the interface's name."""

from collections.abc import Callable

from drivers.bus.frames import Transport
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable


def _socketcand(settings: CanSettings) -> Transport:
    from drivers.bus.interfaces.socketcand import SocketcandTransport

    remote_frames = settings.more.get("remote_frames") is True
    return SocketcandTransport(*_address(settings), str(settings.channel), remote_frames=remote_frames)


def _address(settings: CanSettings) -> tuple[str, int]:
    try:
        return str(settings.more["host"]), int(settings.more["port"])
    except (KeyError, ValueError) as error:
        raise Unavailable("interface socketcand needs the keys host and port in its [can.…] table") from error


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
_LOOK_S = 1.0  # how long a daemon may take to answer
_OWN: dict[str, Callable[[CanSettings], Transport]] = {
    "socketcand": _socketcand,
    "socketcan": _socketcan,
}


def needs_python_can(settings: CanSettings) -> bool:
    """Return whether python-can opens the interface, and not a transport of ours."""
    return settings.interface not in _OWN or (settings.interface == "socketcan" and bool(settings.more))


def open_transport(settings: CanSettings) -> Transport:
    """Open the interface that `settings` name; imports only what it needs. Raises `Unavailable`."""
    return _OWN.get(settings.interface, _python_can)(settings)


def obstacle(settings: CanSettings) -> str | None:
    """Return why the interface could not be opened, or not as `settings` say; it is only looked at."""
    if settings.interface == "socketcan":
        from drivers.bus.interfaces.socketcan import obstacle as socketcan_obstacle

        return socketcan_obstacle(settings)
    if settings.interface == "socketcand":
        return _daemon_obstacle(settings)
    channel = str(settings.channel)
    if channel.startswith("/dev/"):  # an adapter on a serial port
        from drivers.port import obstacle as port_obstacle

        return port_obstacle(channel)
    return None


def _daemon_obstacle(settings: CanSettings) -> str | None:
    import socket

    try:
        host, port = _address(settings)
        socket.create_connection((host, port), _LOOK_S).close()
    except Unavailable as error:
        return str(error)
    except OSError as error:
        reason = error.strerror or str(error)
        return f"nothing answers at {host}:{port} ({reason}): start it, or correct host and port"
    return None


def interfaces() -> tuple[str, ...]:
    """Return every name of an interface that comes with us."""
    return (*sorted(_OWN), *_PYTHON_CAN)


def is_interface(name: str) -> bool:
    """Return whether there is such an interface: one that comes with us, or of a plug-in of python-can."""
    if name in interfaces():
        return True
    from importlib.metadata import entry_points  # for who has a plug-in, or has mistyped, only

    return bool(entry_points(group="can.interface", name=name))
