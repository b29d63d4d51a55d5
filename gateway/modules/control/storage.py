"""Store (1010h) and restore (1011h): what a device keeps over a reset, on command, verified (CiA 301 §7.5.2).

Refused unless the device says that it can, every drive that it may move is known to be at rest, and nothing
is on trial anywhere.
"""

import time
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from drivers.bus.values import unsigned
from drivers.errors import DeviceAbort, DriverError, NotPermitted
from drivers.joint.cia402 import ENERGISED, STATE_WORDS
from gateway.coding import Number, text
from gateway.config.objects import RESTORE, STORE
from gateway.config.robot import DeviceTable, JointTable, RobotConfig
from gateway.modules.control.objects import Node, download, read, result
from gateway.modules.control.parameters import READABLE, Parameter
from gateway.modules.control.rules import Rules
from gateway.modules.control.transaction import Leave
from gateway.modules.control.writer import Turn, Writer
from gateway.process.futures import then
from gateway.records.journal import Share
from gateway.records.records import Records
from gateway.wire.framing import ErrorKind, RpcError, refuse
from gateway.wire.parameter import Stored

if TYPE_CHECKING:
    from gateway.modules.component.module import ComponentModule

ALL = 1  # the sub-index of all parameters
_UNKNOWN = "NOBODY KNOWS whether it did: try again, or compare its values after a reset"
_ON_COMMAND, _BY_ITSELF = 0b01, 0b10  # bits of what it reads as: the device's capabilities


@dataclass(frozen=True, slots=True)
class Command:
    """One of the two: its object, its signature (LSB first), and what it has done."""

    name: str
    index: int
    signature: bytes
    done: str

    @property
    def object(self) -> str:
        return f"0x{self.index:04X}:{ALL}"


STORING = Command("store", STORE, b"save", "stored, and it still holds the same values")
RESTORING = Command(
    "restore",
    RESTORE,
    b"load",
    "confirmed; its defaults act after its next reset (switch it off and on, or NMT reset node, which is not "
    "sent from here), until then it holds what it held",
)


class Storage:
    """Storing of parameters in every device of a robot."""

    def __init__(
        self,
        config: RobotConfig,
        component: "ComponentModule",
        parameters: Mapping[str, Parameter],
        records: Records,
        rules: Rules,
        writer: Writer,
    ) -> None:
        self.config = config
        self.tables: dict[str, JointTable | DeviceTable] = {**config.joint, **config.device}
        self.parameters = parameters
        self.records = records
        self.rules = rules
        self._component = component
        self._writer = writer

    def run(self, command: Command, who: str, component: str, leave: Leave) -> "Future[Stored]":
        """Do it after every write that was asked for before, as long as there is leave.

        Raises:
            RpcError: at once, or as the future's error. device_timeout: it was sent, and nobody knows
                whether it was done; mismatch: it was done, but not as it should be, or not recorded.

        """
        if component not in self.tables:
            known = ", ".join(self.tables) or "none"
            raise refuse(
                ErrorKind.UNKNOWN_NAME, f"{component!r} is no device that can store; here are: {known}"
            )
        ready = self._component.when_ready({component, *self.config.drives_of(component)})
        return then(ready, lambda _none: self._begin(command, who, component, leave))

    def _begin(self, command: Command, who: str, component: str, leave: Leave) -> "Future[Stored]":
        found: Any = self._component.robot.components.get(component)
        if found is None:
            why = self._component.absent.get(component, "it is not there")
            raise refuse(ErrorKind.UNAVAILABLE, f"{component}: {why}", component=component)
        return self._writer.submit(_Run(self, command, who, component, found.node, leave).do, Turn.WRITE)


class _Run:
    """One command to one device, in the writer's thread."""

    def __init__(
        self, storage: Storage, command: Command, who: str, component: str, node: Node, leave: Leave
    ) -> None:
        self._storage = storage
        self._command = command
        self._who = who
        self._component = component
        self._node = node
        self._leave = leave
        self._sharing = storage.config.sharing(component)
        table = storage.tables[component]
        self._address = (table.bus, table.node_id, command.index, ALL)
        self._timeout_s = table.store_timeout_s

    def do(self) -> Stored:
        command = self._command
        try:
            before = self._prepare()
        except RpcError as error:  # nothing was sent; nobody waits for the journal
            journal = self._storage.records.journal
            what = f"{command.name} refused"
            journal.append(self._who, what, Share.ASKED, component=self._component, result=str(error))
            raise
        self._record(command.name, "nothing was sent", Share.ASKED)
        try:
            self._check_drives()  # recording took its time
            self._send()
            self._verify(before)
        except RpcError as error:
            self._record(f"{command.name} FAILED", str(error), kind=error.kind, result=str(error))
            raise
        self._record(f"{command.name} done", command.done, kind=ErrorKind.MISMATCH, result=command.done)
        return Stored(self._component, command.done)

    # Before

    def _prepare(self) -> Mapping[str, tuple[Number, bytes]]:
        """Check all that can be; return what the device holds. A silence is none after the command."""
        try:
            self._check_leave()
            self._check_trials()
            self._check_capability()
            before = self._values() if self._command is STORING else {}
            self._check_drives()
        except RpcError as error:
            if error.kind is ErrorKind.DEVICE_TIMEOUT:
                said, component = f"{error}; nothing was sent", self._component
                raise refuse(ErrorKind.UNAVAILABLE, said, component=component) from error
            raise
        return before

    def _check_leave(self) -> None:
        said = self._leave.objection(self._address)
        if said is not None:
            raise self._refusal(self._leave.kind(said), f"{said}; nothing was sent")
        if self._node.distrust is not None:
            raise self._refusal(ErrorKind.NOT_ALLOWED, self._node.distrust)

    def _check_trials(self) -> None:
        """Refuse while a trial is pending: it would become permanent, and its revert would wait."""
        for undo in self._storage.records.undo.all():
            how = "on trial; confirm or revert" if undo.trial else "still being taken back; wait for"
            names = ", ".join(change.parameter for change in undo.changes)
            said = f"{names}: {how} that first (write {undo.write} of {undo.who})"
            raise self._refusal(ErrorKind.TRIAL_PENDING, said)

    def _check_capability(self) -> None:
        capability = self._capability()
        if not capability & _ON_COMMAND:
            why = "it does that by itself, not on command" if capability & _BY_ITSELF else "it cannot"
            said = f"the device says that {why} ({self._command.object} reads 0x{capability:08X})"
            raise self._refusal(ErrorKind.NOT_ALLOWED, said)

    def _check_drives(self) -> None:
        drives = self._storage.config.drives_of(self._component)
        for drive, (state, why) in self._storage.rules.states(drives).items():
            if state is None or state in ENERGISED:
                said = f"unknown: {why}" if state is None else STATE_WORDS[state]
                raise self._refusal(
                    ErrorKind.WRONG_STATE,
                    f"the state of {drive} is {said}; a device may not answer while it writes its memory: "
                    "stop the drives first",
                )

    # The command

    def _send(self) -> None:
        command = self._command
        try:
            download(self._node, self._address, command.signature, self._leave.objection, self._timeout_s)
        except NotPermitted as error:
            self._check_leave()
            raise self._refusal(ErrorKind.NOT_ALLOWED, f"{error}; nothing was sent") from error
        except DeviceAbort as error:
            raise self._device_error(error) from error
        except (DriverError, TimeoutError) as error:
            said = f"{self._device_error(error)}; {_UNKNOWN}"
            kind, component = ErrorKind.DEVICE_TIMEOUT, self._component
            raise refuse(kind, said, component=component, object=command.object) from error

    # Afterwards

    def _verify(self, before: Mapping[str, tuple[Number, bytes]]) -> None:
        """Compare after the confirmation; an unreadable value is unknown, whatever the reason."""
        try:
            self._check_answers()
            self._check_unchanged(before)
        except RpcError as error:
            if error.kind is ErrorKind.MISMATCH:
                raise
            said = f"the device confirmed, but then: {error}"
            raise refuse(ErrorKind.DEVICE_TIMEOUT, said, component=self._component) from error

    def _check_answers(self) -> None:
        """Wait until the busy device answers again, and still says that it can store."""
        deadline = time.monotonic() + self._timeout_s
        while True:
            try:
                return self._check_capability()
            except RpcError as error:
                if error.kind is not ErrorKind.DEVICE_TIMEOUT or time.monotonic() > deadline:
                    raise

    def _capability(self) -> int:
        try:
            return unsigned(result(self._node.upload(self._command.index, ALL)))
        except (DriverError, TimeoutError) as error:
            raise self._device_error(error) from error

    def _values(self) -> dict[str, tuple[Number, bytes]]:
        """Return the device's writable values, as of now."""
        found = {}
        for one in self._storage.parameters.values():
            usable = one.problem is None and one.lock is None and one.access in READABLE
            if usable and one.component in self._sharing:
                data = read(one, self._node)
                found[one.name] = (one.decode(data), data)
        return found

    def _check_unchanged(self, before: Mapping[str, tuple[Number, bytes]]) -> None:
        after = self._values() if before else {}
        changed = [
            f"{name} was {text(value)} and is {text(after[name][0])}"
            for name, (value, data) in before.items()
            if after[name][1] != data
        ]
        if changed:
            raise self._refusal(ErrorKind.MISMATCH, f"it was done, but {', '.join(changed)}")

    # Words

    def _record(
        self,
        what: str,
        so: str,
        share: Share = Share.OUTCOME,
        /,
        kind: ErrorKind = ErrorKind.UNAVAILABLE,
        **details: str,
    ) -> None:
        """Append an entry durably; raises `RpcError` if that fails, `so` says what then."""
        journal = self._storage.records.journal
        try:
            journal.append(self._who, what, share, component=self._component, **details).result()
        except OSError as error:
            said = f"it could not be recorded: {error.strerror or error}; {so}"
            raise self._refusal(kind, said) from error

    def _device_error(self, error: Exception) -> RpcError:
        kinds = ((DeviceAbort, ErrorKind.DEVICE_ABORT), (TimeoutError, ErrorKind.DEVICE_TIMEOUT))
        kind = next((kind for type_, kind in kinds if isinstance(error, type_)), ErrorKind.UNAVAILABLE)
        return self._refusal(kind, str(error) or "no answer", getattr(error, "abort_code", None))

    def _refusal(self, kind: ErrorKind, said: str, abort_code: int | None = None) -> RpcError:
        command = self._command
        return refuse(
            kind,
            f"{command.name} {self._component}: {said}",
            component=self._component,
            object=command.object,
            abort_code=abort_code,
        )
