"""Blocking SDO transfers over one channel to one node, errors in the drivers' own words.

A read that stays unanswered is repeated; a write never is, because the device may have taken it. As long as
an earlier request about an object may still be answered, the next one is not sent: first another object is
read, whose answer shows that none of those can come any more (see `outstanding`).
"""

import contextlib
import queue
import threading
import time
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from drivers.bus.confirmed_writes import ConfirmedWrites
from drivers.bus.sdo import protocol
from drivers.bus.sdo.aborts import abort_text
from drivers.bus.sdo.answers import Answers, SdoCounters
from drivers.bus.sdo.outstanding import Outstanding, Request
from drivers.bus.sdo.round_trips import RoundTrips
from drivers.bus.sdo.transfer import Transfer, nothing, read, write
from drivers.bus.sender import StillLeaving
from drivers.errors import DeviceAbort, DeviceTimeout, NotPermitted, Unavailable

T = TypeVar("T")

READ_ATTEMPTS = 3
OUT_OF_SYNC = 3  # attempts in a row to bring a node in sync that does send something
SECOND_LOOKS = 2  # reads before a write, where the last answer came twice: the first one's second may be slow
_UNKNOWN = "whether the device took it is not known, read it back"


class Interrupted(Exception):
    """An urgent job wants the channel: the running one ends here and, as far as it only read, runs again."""


class Outlet(Protocol):
    """Outlet of a channel's requests to the bus; see `CanBus.offer` and `CanBus.send_urgent`."""

    def offer(self, data: bytes, wanted: Callable[[], bool]) -> Callable[[], bool]: ...

    def send_urgent(self, data: bytes) -> bool: ...


class SdoProtocolBroken(DeviceTimeout):
    """The device answered, but not as the SDO protocol says: nothing is known about the transfer."""


def _always() -> bool:
    return True


def _end() -> None:
    raise Interrupted


class SdoChannel:
    """One SDO channel. `upload` and `download` are for one thread; the rest for any."""

    def __init__(
        self,
        label: str,
        outlet: Outlet,
        timeout_s: float,
        distrust: Callable[[], str | None] = nothing,
    ) -> None:
        """`distrust` says why not to write."""
        self.label = label
        self.timeout_s = timeout_s
        self.counters = SdoCounters()
        self.also_silent = ""  # what else than the device may be the cause of its silence, in words
        self.answered_ns = 0  # when the device last did, or refused, what it was asked
        self._outlet = outlet
        self._distrust = distrust
        self._interrupted = threading.Event()
        self._sending = threading.Lock()  # so that nothing goes out behind what interrupted it
        self._in_flight: tuple[int, int] | None = None  # the object that a transfer is about
        self._ahead: Request | None = None  # went out before the job that waits for its answer
        self._outstanding = Outstanding()
        self.round_trips = RoundTrips(timeout_s)
        self._answers = Answers(self._outstanding, self.counters, self.round_trips)
        self._unassigned = 0  # failed attempts to bring it in sync, in a row
        self._written = ConfirmedWrites()
        self._urgent = False
        self._current: Callable[[], bool] = _always
        self._pause: Callable[[], None] = _end

    @property
    def doubled(self) -> bool:
        """Whether its requests are answered twice, each of them."""
        return self._answers.doubled

    @property
    def out_of_sync(self) -> bool:
        """Whether something answers, but nobody can say to which request."""
        return self._unassigned >= OUT_OF_SYNC

    def known(self, index: int, subindex: int, otherwise: bytes | None = None) -> bytes | None:
        """Return the value confirmed since the device came up, `otherwise` if none was written.

        `None` where nobody knows: a write of it is under way, or stayed unanswered.
        """
        return self._written.known((index, subindex), otherwise)

    def is_unsure(self, index: int, subindex: int) -> bool:
        """Return whether it was written, and nobody knows whether the device took it."""
        return self._written.is_unsure((index, subindex))

    # What comes, and who is first.

    def on_response(self, stamp_ns: int, data: bytes) -> None:
        """Take a frame with the identifier of this channel's responses; called in the bus's thread."""
        if len(data) == 8:
            self._answers.put(stamp_ns, data)

    def interrupt(self, ahead: bytes | None = None) -> None:
        """End the transfer in flight, refuse further ones until `resume`, and send a request `ahead`.

        The job that comes next finds that request sent when it makes it, and waits for the answer. The one
        that is interrupted learns of it when it next turns here, or by `wake`.
        """
        with self._sending:
            self._interrupted.set()
            self._ahead = None
            if self._in_flight is not None:
                self._end_transfer(*self._in_flight, protocol.GENERAL_ERROR)
            self._in_flight = None
            if ahead is not None:
                self._written.doubt((int.from_bytes(ahead[1:3], "little"), ahead[3]))
                request = self._outstanding.add(ahead[1:4], ahead)  # before it can be answered
                self._outlet.send_urgent(ahead)
                self._ahead = request

    def wake(self) -> None:
        """Let a job that waits for an answer look whether it was interrupted."""
        self._answers.wake()

    def resume(
        self,
        *,
        urgent: bool = False,
        current: Callable[[], bool] = _always,
        pause: Callable[[], None] = _end,
    ) -> None:
        """Allow transfers again, to one job.

        The writes of an `urgent` one wait for nothing, and are sent whoever answers. Transfers of one that is
        no longer `current` fail. `pause` is called where it is interrupted, and returns when it may go on.
        """
        self._urgent, self._current, self._pause = urgent, current, pause
        self._interrupted.clear()

    def forget_written(self) -> None:
        """Note that the device may hold other values than written."""
        self._written.forget()

    def rebooted(self) -> None:
        """Forget requests and writes after a boot of the node."""
        self._outstanding.forget()
        self._written.forget()
        self._answers.forget_doubles()
        self._unassigned = 0
        self.round_trips.restart()

    def pause(self, seconds: float) -> None:
        """Wait between two transfers of a job, as long as nothing more urgent wants the channel."""
        if self._interrupted.wait(seconds):
            raise Interrupted

    # Transfers.

    def upload(
        self, index: int, subindex: int, attempts: int = READ_ATTEMPTS, timeout_s: float | None = None
    ) -> bytes:
        """Read an object; raises `DeviceAbort`, `DeviceTimeout` or `Unavailable`.

        What it returns, the device held after this was called.
        """
        transfer = read(self.label, index, subindex, timeout_s or self.timeout_s)
        for _ in range(attempts - 1):
            with contextlib.suppress(DeviceTimeout):
                return self._perform(transfer)
        return self._perform(transfer)

    def download(
        self,
        index: int,
        subindex: int,
        data: bytes,
        timeout_s: float | None = None,
        permitted: Callable[[], str | None] | None = None,
    ) -> None:
        """Write an object, once; raises `DeviceAbort`, `DeviceTimeout` or `Unavailable`.

        `permitted` says why it may not be written, `None` where it may: then it is in the bus's hands before
        anything that interrupts this. It must return at once, and wait for nothing that such a caller has.
        Where it objects, nothing is sent and `NotPermitted` is raised. It is asked before each frame of a
        longer write; once that has begun, an objection aborts it, and it is one that was not answered.
        """
        patience_s = timeout_s or self.timeout_s
        transfer = write(self.label, index, subindex, data, patience_s, permitted or nothing)
        try:
            self._perform(transfer)
        except DeviceAbort:
            self._written.withdraw()
            raise
        except (Interrupted, DeviceTimeout, NotPermitted, StillLeaving) as error:
            if not transfer.write_begun:
                raise
            why = str(error) or f"{transfer.what}: interrupted by an urgent request"
            raise DeviceTimeout(f"{why}; {_UNKNOWN}") from error
        else:
            self._written.confirm((index, subindex), data)
        finally:
            self._written.leave()

    def _perform(self, transfer: Transfer[T]) -> T:
        while True:
            try:
                return self._attempt(transfer)
            except Interrupted:
                if transfer.write_begun:
                    raise
                self._pause()

    def _attempt(self, transfer: Transfer[T]) -> T:
        self._check_interrupted()
        if not self._current():
            raise Unavailable(f"{transfer.what}: given up, the node began anew")
        self.counters.transfers += 1
        try:
            result = self._run(transfer)
        except protocol.SdoAborted as error:
            self.counters.aborts += 1
            self.answered_ns = time.monotonic_ns()
            text = f"{transfer.what}: refused, {abort_text(error.abort_code)}"
            raise DeviceAbort(text, error.abort_code) from error
        except protocol.SdoProtocolError as error:
            self._abort(transfer, error.abort_code)
            raise SdoProtocolBroken(
                f"{transfer.what}: the device {error}, against the SDO protocol"
            ) from error
        except NotPermitted:
            if transfer.write_begun:
                self._abort(transfer, protocol.GENERAL_ERROR)
            raise
        except queue.Empty as error:
            self._count_timeout()
            self._abort(transfer, protocol.TIMED_OUT)
            text = f"{transfer.what}: no answer within {transfer.timeout_s:g} s{self.also_silent}"
            raise DeviceTimeout(text) from error
        else:
            self.answered_ns = time.monotonic_ns()
            return result
        finally:
            self._in_flight = None
            if transfer.request is not None:
                transfer.request.given_up = True

    def _run(self, transfer: Transfer[T]) -> T:
        self._answers.fetch_waiting()
        steps = transfer.begin()
        request = next(steps)
        answer = self._synchronise(transfer)
        try:
            while True:
                request = steps.send(answer or self._ask(transfer, request))
                answer = None
        except StopIteration as done:
            self._unassigned = 0
            result: T = done.value
            return result

    def _ask(self, transfer: Transfer[Any], frame: bytes) -> bytes:
        request = self._hand_over(transfer, frame)
        deadline = time.monotonic() + transfer.timeout_s
        while request.answer is None:
            self._answers.fetch(deadline)
            if request.answer is None:
                self._check_interrupted()
        return request.answer

    # In sync.

    def _synchronise(self, transfer: Transfer[Any]) -> bytes | None:
        """Return when an answer about the object can only be to what is asked now.

        Or with the answer, where it comes meanwhile, late, to what this very read has asked before.
        """
        if self._urgent and transfer.is_expedited_write:
            return None
        deadline = time.monotonic() + transfer.timeout_s
        if self._is_ambiguous(transfer):
            self.counters.resyncs += 1
            while self._is_ambiguous(transfer):
                self._read_another(transfer, deadline, lambda: self._is_ambiguous(transfer))
        if transfer.data is not None and self._answers.perhaps_doubled:
            for _ in range(SECOND_LOOKS):
                self._read_another(transfer, deadline, _always)
        return transfer.late_answer

    def _is_ambiguous(self, transfer: Transfer[Any]) -> bool:
        """Return whether its answer could be one to an earlier request."""
        return self._outstanding.holds(transfer.about) and transfer.late_answer is None

    def _read_another(self, transfer: Transfer[Any], deadline: float, needed: Callable[[], bool]) -> None:
        """Read another object until it is answered, or no longer needed."""
        index, subindex = self._outstanding.probe(transfer.about)
        probe = read(self.label, index, subindex, transfer.timeout_s)
        request = self._hand_over(probe, next(probe.begin()))
        try:
            while request.answer is None and needed():
                self._answers.fetch(deadline)
                self._check_interrupted()
        except queue.Empty as error:
            self._count_timeout()
            self._unassigned += self._outstanding.heard
            raise DeviceTimeout(
                f"{transfer.what}: not asked, because an answer could be a late one to an earlier request; "
                f"0x{index:04X}:{subindex:02X}, which would tell, was not answered within "
                f"{transfer.timeout_s:g} s"
            ) from error
        finally:
            request.given_up = True
        if request.answer is not None and not protocol.concludes(request.answer, request.frame):
            self._abort(probe, protocol.GENERAL_ERROR)  # its data is of no interest

    def _count_timeout(self) -> None:
        self.counters.timeouts += 1
        self.round_trips.unanswered(time.monotonic_ns())

    # What goes out.

    def _hand_over(self, transfer: Transfer[Any], frame: bytes) -> Request:
        """Send a request, and return when the bus has it; nobody waits for that with the lock."""
        begins = transfer.data is not None and transfer.request is None
        with self._sending:
            self._check_interrupted()
            ahead, self._ahead = self._ahead, None
            is_sent = ahead is not None and ahead.frame == frame
            if not is_sent:
                self._check_permitted(transfer)
            if begins:
                self._written.begin((transfer.index, transfer.subindex))
            if ahead is not None and is_sent:
                request, sent = ahead, _always
            else:
                request, sent = self._offer(transfer, frame, begins=begins)
            self._in_flight = (transfer.index, transfer.subindex)
        self._await_sent(transfer, request, sent, begins=begins)
        transfer.request = request
        return request

    def _offer(
        self, transfer: Transfer[Any], frame: bytes, *, begins: bool
    ) -> tuple[Request, Callable[[], bool]]:
        """Offer a frame to the bus; if it has to wait for its turn, it is asked again whether it may go."""

        def wanted() -> bool:
            return not self._interrupted.is_set() and not self._objection(transfer)

        request = self._outstanding.add(transfer.about, frame)  # before it can be answered
        try:
            return request, self._outlet.offer(frame, wanted)
        except Unavailable:
            self._forget_unsent(request, begins=begins)
            raise

    def _await_sent(
        self, transfer: Transfer[Any], request: Request, sent: Callable[[], bool], *, begins: bool
    ) -> None:
        try:
            if sent():
                return
        except StillLeaving:
            transfer.request = request  # nobody knows: it may yet be answered
            raise
        except Unavailable:
            with self._sending:
                self._forget_unsent(request, begins=begins)
            raise
        with self._sending:
            self._forget_unsent(request, begins=begins)
        self._check_interrupted()
        self._check_permitted(transfer)
        raise Unavailable(f"{transfer.what}: it was not sent")

    def _forget_unsent(self, request: Request, *, begins: bool) -> None:
        self._outstanding.drop(request)
        if begins:
            self._written.withdraw()

    def _check_permitted(self, transfer: Transfer[Any]) -> None:
        """Raise `NotPermitted` where a write that is about to begin, or go on, must not."""
        why = self._objection(transfer)
        if why is not None:
            raise NotPermitted(f"{transfer.what}: {'ended' if transfer.write_begun else 'not sent'}: {why}")

    def _objection(self, transfer: Transfer[Any]) -> str | None:
        if transfer.data is None:
            return None
        return transfer.permitted() or (None if self._urgent else self._distrust())

    def _abort(self, transfer: Transfer[Any], abort_code: int) -> None:
        with self._sending:
            if not self._interrupted.is_set():  # else it was sent, and something else is in flight
                self._end_transfer(transfer.index, transfer.subindex, abort_code)

    def _end_transfer(self, index: int, subindex: int, abort_code: int) -> None:
        """Tell the device, which answers nothing to that."""
        self._outlet.send_urgent(protocol.abort_request(index, subindex, abort_code))

    def _check_interrupted(self) -> None:
        if self._interrupted.is_set():
            raise Interrupted
