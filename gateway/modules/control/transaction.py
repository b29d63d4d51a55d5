"""One write of several parameters: all or nothing, each verified by reading it back.

Current values are read first, and everything is checked before the first download; what may have become
another since, a stop and the drives' states, again before each. What is to be taken back is on disk, and in
the journal, before the first; whatever goes wrong afterwards takes back all that may have changed, in reverse
order, verified. Runs in the writer's thread.
"""

from collections.abc import Callable
from dataclasses import dataclass

from drivers.errors import DriverError, NotPermitted
from gateway.modules.control.ledger import WriteLedger
from gateway.modules.control.objects import ObjectWrite, device_error, download, read
from gateway.modules.control.reverting import AS_IT_SHOULD_BE, TAKEN_BACK, Attempt
from gateway.modules.control.rules import Rules, allowed_states
from gateway.modules.stop.authority import Address, Permit
from gateway.wire.framing import ErrorKind, RpcError, internal_error, refuse
from gateway.wire.parameter import PARAMETER_WRITE

ENDING = "the gateway is ending"
NOT_WRITTEN = "not written"
NOTHING = "nothing was written"


@dataclass(frozen=True, slots=True)
class Leave:
    """Permission of one write: as of its request, until a stop, or until nobody wants it."""

    permit: Permit
    overtaken: Callable[[], str | None]  # by what it has become pointless

    def objection(self, address: Address) -> str | None:
        """Return why an object must not be written now, in words. From any thread."""
        return self.overtaken() or self.permit.objection(address)

    def kind(self, said: str) -> ErrorKind:
        """Return the kind of error of an objection."""
        if said == ENDING:
            return ErrorKind.UNAVAILABLE
        allowed = said not in (self.overtaken(), self.permit.authority.frozen())
        return ErrorKind.STOPPED if allowed else ErrorKind.NOT_ALLOWED


@dataclass(frozen=True, slots=True)
class TransactionResult:
    """Values as the devices hold them."""

    before: dict[str, float]
    after: dict[str, float]


class Transaction:
    """One write. `let_pass` is called between two changes: what is more urgent may take its turn there."""

    def __init__(
        self,
        changes: list[ObjectWrite],
        rules: Rules,
        leave: Leave,
        ledger: WriteLedger,
        let_pass: Callable[[], None],
    ) -> None:
        self._changes = changes
        self._rules = rules
        self._leave = leave
        self._ledger = ledger
        self._let_pass = let_pass
        self._before: dict[str, bytes] = {}
        self._touched: set[str] = set()

    def run(self) -> TransactionResult:
        """Do it.

        Raises:
            RpcError: nothing has changed; or everything was taken back (rolled_back); or that failed
                (rollback_failed), and `outcome` says what each parameter holds.

        """
        try:
            self._prepare()
        except RpcError as error:
            self._ledger.refused(self._changes, error)
            if len(self._changes) > 1 and NOTHING not in str(error):  # nobody is to wonder about the others
                raise RpcError(f"{error}; {NOTHING}", error.data, error.code) from error
            raise
        try:
            for change in self._changes:
                self._apply(change)
            for change in self._changes:
                self._check_leave(change)  # a stop may have come with the last download
            self._ledger.done()
        except RpcError as error:
            raise self._roll_back(error) from error
        except Exception as error:
            raise self._roll_back(internal_error(PARAMETER_WRITE.name, error)) from error
        return TransactionResult(
            {one.name: self._value_before(one) for one in self._changes},
            {one.name: one.parameter.decode(one.data) for one in self._changes},
        )

    # Before

    def _prepare(self) -> None:
        """Read, check, and put into a safe order.

        What becomes smaller comes first, so that a torque or a speed is limited before a gain grows; taking
        back goes the other way round.
        """
        for change in self._changes:
            self._check_leave(change)
        self._before = self._current()
        for change in self._changes:
            self._check_leave(change)  # reading may have shown that two devices answer
            self._rules.check_value(change.parameter, self._before[change.name], change.data)
            self._check_way_back(change)
        rules = {(one.parameter.component, allowed_states(one.parameter)): one for one in self._changes}
        for change in rules.values():
            self._rules.check_states(change.parameter)
        self._changes.sort(key=lambda one: abs(one.parameter.decode(one.data)) > abs(self._value_before(one)))
        self._ledger.begin(self._changes, self._before)

    def _check_leave(self, change: ObjectWrite) -> None:
        said = self._leave.objection(self._rules.address(change.parameter))
        if said is not None:
            raise change.parameter.refusal(self._leave.kind(said), said)
        silence = self._rules.silence(change.parameter.component)
        if silence is not None:
            raise change.parameter.refusal(ErrorKind.UNAVAILABLE, silence)
        if change.node.distrust is not None:
            raise change.parameter.refusal(ErrorKind.NOT_ALLOWED, change.node.distrust)

    def _current(self) -> dict[str, bytes]:
        """Return the devices' present values.

        Read anew where a trial that this one takes over has ended meanwhile.
        """
        while True:
            replaced = self._ledger.replaced(self._changes)
            found = {}
            for change in self._changes:
                self._let_pass()
                found[change.name] = read(change.parameter, change.node)
            if self._ledger.replaced(self._changes) == replaced:
                return found

    def _value_before(self, change: ObjectWrite) -> float:
        return change.parameter.decode(self._before[change.name])

    def _check_way_back(self, change: ObjectWrite) -> None:
        """Refuse a trial that could not be reverted at its end."""
        goal = self._ledger.goal(change, self._before[change.name])
        if goal is None:
            return
        try:
            self._rules.check_value(change.parameter, change.data, goal)
        except RpcError as error:
            text = f"it could not be taken back at the end of the trial: {error}"
            raise change.parameter.refusal(error.kind, text, error.data.limit) from error

    # The downloads

    def _apply(self, change: ObjectWrite) -> None:
        self._let_pass()
        parameter, node = change.parameter, change.node
        self._check_leave(change)
        self._rules.check_states(parameter)
        self._touched.add(change.name)
        try:
            download(node, self._rules.address(parameter), change.data, self._leave.objection)
        except NotPermitted as error:
            self._touched.remove(change.name)
            self._check_leave(change)
            raise parameter.refusal(ErrorKind.NOT_ALLOWED, str(error)) from error
        except (DriverError, TimeoutError) as error:
            raise device_error(parameter, f"writing {parameter.decode(change.data):g} to", error) from error
        self._verify(change, read(parameter, node))

    def _verify(self, change: ObjectWrite, found: bytes) -> None:
        if found == change.data:
            return
        self._ledger.made(change.name, found)
        parameter, value = change.parameter, change.parameter.decode(change.data)
        text = f"{value:g} was written, the device holds {found.hex(' ')} ({parameter.object})"
        raise parameter.refusal(ErrorKind.MISMATCH, text)

    # Afterwards

    def _roll_back(self, cause: RpcError) -> RpcError:
        written = [one for one in self._ledger.changes if one.parameter in self._touched]
        authority, ledger = self._leave.permit.authority, self._ledger
        attempt = Attempt(self._rules, authority, ledger.undos, ledger.number, self._let_pass)
        found = attempt.take_back(written)
        outcome = {one.name: NOT_WRITTEN for one in self._changes} | found.outcome
        answer = _answer(cause, outcome)
        self._ledger.rolled_back(answer, found.left)
        return answer


def _answer(cause: RpcError, outcome: dict[str, str]) -> RpcError:
    """Return why a write has failed, and what became of each parameter."""
    failed = [name for name, what in outcome.items() if what not in {NOT_WRITTEN, *AS_IT_SHOULD_BE}]
    taken_back = TAKEN_BACK in outcome.values()
    kind = ErrorKind.ROLLBACK_FAILED if failed else ErrorKind.ROLLED_BACK if taken_back else cause.kind
    text = str(cause)
    if failed:
        text += f"; and could not be taken back: {', '.join(failed)}; read them before you go on"
    elif taken_back:
        text += "; everything was taken back"
    data = cause.data
    return refuse(
        kind,
        text,
        component=data.component,
        object=data.object,
        abort_code=data.abort_code,
        limit=data.limit,
        outcome=outcome,
    )
