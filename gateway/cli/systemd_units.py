"""The systemd units of a gateway: on demand behind a socket, or at boot where the robot has a guard."""

import os
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from gateway.access.folder import AccessFolder
from gateway.config.robot import RobotConfig
from gateway.connections.listeners import BACKLOG, CLASSIC, PORT

MARK = "# Written by gwrms install-service; put changes into `systemctl edit`, or write it again."
STATE = "gwrms"  # under /var/lib
RUNTIME = "/run/gwrms"  # where its Unix socket is
USER_RUNTIME = "%t/gwrms"  # the same for a user's own service
LEAST_LINGER_S = 2.0  # a gateway that ends sooner may be started more often than it is allowed to
MOST_STARTS = "StartLimitBurst=30"

_WATCHED = "Restart=on-failure\nRestartSec=1\nWatchdogSec=10\nCPUWeight=500"
_CALLED = "Restart=on-abnormal\nRestartSec=1\nCPUWeight=20"  # with a wrong file it waits for the next client
_BOUNDS = "MemoryMax=256M\nTasksMax=64\nLimitNOFILE=8192\nLimitCORE=0\nEnvironment=MALLOC_ARENA_MAX=1"
_URGENT = "LimitRTPRIO=30\nLimitMEMLOCK=infinity"  # for the threads that stop the drives

# What a gateway can do without. It reads other processes and serial ports, and speaks CAN and TCP.
_HARDENED = """\
NoNewPrivileges=yes
ProtectSystem=strict
ProtectHome=read-only
PrivateTmp=yes
ProtectKernelTunables=yes
ProtectKernelModules=yes
ProtectKernelLogs=yes
ProtectControlGroups=yes
RestrictNamespaces=yes
RestrictSUIDSGID=yes
RestrictAddressFamilies=AF_INET AF_INET6 AF_UNIX AF_CAN AF_NETLINK
LockPersonality=yes
CapabilityBoundingSet=
SystemCallArchitectures=native
UMask=0027"""
_HARDENED_USER = "NoNewPrivileges=yes\nUMask=0027"  # more needs rights that a user's manager does not have


# What may stand in a unit: there, a line's end begins another setting, and some signs mean something.
_HOST = re.compile(r"[0-9A-Za-z][0-9A-Za-z.-]*|[0-9A-Fa-f:.]*:[0-9A-Fa-f:.]*")
_ACCOUNT = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,31}")
_UNIT = re.compile(r"[A-Za-z0-9_-]{1,200}")


class NotForUnits(ValueError):
    """Something that is to stand in a unit could say more there than it should."""


@dataclass(frozen=True, slots=True)
class Service:
    """The service to install: the robot's file, for the whole computer as `user`, or one user's session."""

    config: RobotConfig
    name: str = "gwrms"
    of_user: bool = False
    user: str | None = None  # None: one that systemd makes up

    def __post_init__(self) -> None:
        """Refuse what may not stand in a unit.

        Raises:
            NotForUnits: says what it is, and what may.

        """
        config = self.config
        _fits(_UNIT, self.name, "the units' name", "letters, digits, _ and -")
        if not self.at_boot:
            _fits(_HOST, config.gateway.host, f"host in {config.path}", "an address without a zone")
        if self.user is not None:
            _fits(_ACCOUNT, self.user, "the account", "letters, digits, _ . and -, at most 32")
        for path in (Path(sys.executable), config.path.absolute(), self._records, config.access.absolute()):
            _readable(str(path), "the path")
        _readable(" ".join(config.robot.name.split()), f"name in {config.path}")

    @property
    def at_boot(self) -> bool:
        """Whether it must run without any client."""
        return self.config.guard is not None

    @property
    def enabled(self) -> list[str]:
        """The units that are to be enabled; the others are started by them."""
        units = self.units
        return [name for name in units if self.at_boot or not name.endswith(".service")]

    @property
    def units(self) -> Mapping[str, str]:
        """File name → text."""
        if self.at_boot:
            return {f"{self.name}.service": self._service()}
        gateway = self.config.gateway
        units = {f"{self.name}.socket": self._socket(gateway.port, PORT)}
        if gateway.classic_port is not None:
            units[f"{self.name}-classic.socket"] = self._socket(gateway.classic_port, CLASSIC)
        sockets = " ".join(units)
        return units | {f"{self.name}.path": self._path(), f"{self.name}.service": self._service(sockets)}

    def _service(self, sockets: str | None = None) -> str:
        what = "with its guard" if self.at_boot else "on demand"
        lines = [MARK, f"[Unit]\nDescription={self._gateway}, {what}"]
        # A guard is never given up; what a socket or path starts again and again without end, is.
        lines.append(
            "StartLimitIntervalSec=0" if self.at_boot else f"StartLimitIntervalSec=60\n{MOST_STARTS}"
        )
        if sockets is not None:
            lines.append(f"Requires={sockets}\nAfter={sockets}")
        lines += [
            "\n[Service]\nType=notify",
            f"ExecStart={self._command}",
            _WATCHED if self.at_boot else _CALLED,
        ]
        lines += [
            *self._keys,
            _BOUNDS,
            _URGENT,
            _HARDENED_USER if self.of_user else f"{self._account}\n{_HARDENED}",
        ]
        return "\n".join(lines) + "\n" + (self._wanted if self.at_boot else "")

    @property
    def _keys(self) -> list[str]:
        """The robot's own, which the account that it runs as could not read."""
        folder = AccessFolder(self.config.access.absolute(), {})
        if self.of_user or not folder.has_keys:
            return []
        return [f"LoadCredential={one.name}:{_escaped(one)}" for one in (folder.key, folder.certificate)]

    @property
    def _gateway(self) -> str:
        return f"GWRMS gateway of {_escaped(' '.join(self.config.robot.name.split()))}"

    @property
    def _wanted(self) -> str:
        return f"\n[Install]\nWantedBy={'default.target' if self.of_user else 'multi-user.target'}\n"

    def _socket(self, port: int, name: str) -> str:
        host = self.config.gateway.host
        address = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
        folder = USER_RUNTIME if self.of_user else RUNTIME
        local = f"ListenStream={folder}/{self.name}.sock\n" if name == PORT else ""
        return (
            f"{MARK}\n[Unit]\nDescription=Port {port} of the {self._gateway}\n\n[Socket]\n"
            f"ListenStream={address}\n{local}FileDescriptorName={name}\nService={self.name}.service\n"
            f"Backlog={BACKLOG}\nFreeBind=yes\n\n[Install]\nWantedBy=sockets.target\n"
        )

    def _path(self) -> str:
        """Return the path unit, which starts it if a stop is held or a write must be reverted."""
        folder = self._records
        return (
            f"{MARK}\n[Unit]\nDescription=What the {self._gateway} has to finish\n\n"
            f"[Path]\nPathExists={_escaped(folder / 'stop.json')}\n"
            f"PathExists={_escaped(folder / 'undo.json')}\nUnit={self.name}.service\n{self._wanted}"
        )

    @property
    def _records(self) -> Path:
        """Where the service keeps its records."""
        if self.of_user or self.config.gateway.records is not None:
            return self.config.records.absolute()
        return Path("/var/lib", STATE, self.config.records.name)

    @property
    def _command(self) -> str:
        words = [sys.executable, "-P", "-m", "gateway.main", "gateway", str(self.config.path.absolute())]
        return " ".join(map(_quoted, words))

    @property
    def _account(self) -> str:
        who = "DynamicUser=yes" if self.user is None else f"User={self.user}"
        lines = [who, "SupplementaryGroups=dialout", f"StateDirectory={STATE}", "StateDirectoryMode=0750"]
        if self.at_boot:  # else systemd itself listens there
            lines.append("RuntimeDirectory=gwrms\nRuntimeDirectoryMode=0755")
        if self.config.gateway.records is not None:
            lines.append(f"ReadWritePaths={_quoted(f'-{self._records}')}")
        return "\n".join(lines)


def _fits(pattern: re.Pattern[str], given: str, what: str, allowed: str) -> None:
    if not pattern.fullmatch(given):
        raise NotForUnits(f"{what} cannot stand in a systemd unit: {given!r}; give {allowed}")


def _readable(given: str, what: str) -> None:
    if not given.isprintable() or "\\" in given:
        raise NotForUnits(
            f"{what} cannot stand in a systemd unit: {given!r}; leave out backslashes, line ends and "
            "whatever else cannot be printed"
        )


def _escaped(path: Path | str) -> str:
    """Return it as it stands in a unit: a per cent sign begins a specifier."""
    return str(path).replace("%", "%%")


def _quoted(word: str) -> str:
    """One word of a command line (systemd.service(5), Command lines)."""
    escaped = _escaped(word.replace("\\", "\\\\").replace('"', '\\"')).replace("$", "$$")
    return f'"{escaped}"' if set(escaped) & set(" \t'\"\\;") else escaped


def folder(*, of_user: bool) -> Path:
    """Return the folder of the units."""
    if not of_user:
        return Path("/etc/systemd/system")
    given = os.environ.get("XDG_CONFIG_HOME")
    return (Path(given) if given else Path.home() / ".config") / "systemd" / "user"
