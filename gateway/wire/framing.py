"""The wire: JSON-RPC 2.0, one UTF-8 message a line; framing, envelopes, errors. Pure, no I/O.

Methods are declared in the files beside this one. Numbers that are not finite never reach the wire: msgspec
encodes NaN and infinities as `null`.
"""

import json
from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Any, Final, Literal, TypeVar

import msgspec
from msgspec import UNSET, Raw, Struct, UnsetType

from gateway.decode_errors import plainly
from gateway.wire.limits import LINE_LIMIT, NAME_LENGTH

PROTOCOL: Final = 1
ANSWER_LIMIT: Final = 16 * 1024 * 1024  # what a client accepts as one line

Id = int | str | None

PARSE_ERROR: Final = -32700
INVALID_REQUEST: Final = -32600
METHOD_NOT_FOUND: Final = -32601
INVALID_PARAMS: Final = -32602
INTERNAL_ERROR: Final = -32603


class ErrorKind(StrEnum):
    """Kind of an error, for programs; the message is for people."""

    BAD_PARAMS = "bad_params"
    UNKNOWN_NAME = "unknown_name"
    NO_LEASE = "no_lease"
    LEASE_HELD = "lease_held"
    NOT_ALLOWED = "not_allowed"
    OUT_OF_LIMIT = "out_of_limit"
    WRONG_STATE = "wrong_state"
    READ_ONLY = "read_only"
    TRIAL_PENDING = "trial_pending"
    DEVICE_ABORT = "device_abort"
    DEVICE_TIMEOUT = "device_timeout"
    MISMATCH = "mismatch"
    ROLLED_BACK = "rolled_back"
    ROLLBACK_FAILED = "rollback_failed"
    UNAVAILABLE = "unavailable"
    STOPPED = "stopped"


CODES: Final[Mapping[ErrorKind, int]] = {
    ErrorKind.BAD_PARAMS: INVALID_PARAMS,
    ErrorKind.UNKNOWN_NAME: -32001,
    ErrorKind.NO_LEASE: -32002,
    ErrorKind.LEASE_HELD: -32003,
    ErrorKind.NOT_ALLOWED: -32004,
    ErrorKind.OUT_OF_LIMIT: -32005,
    ErrorKind.WRONG_STATE: -32006,
    ErrorKind.READ_ONLY: -32007,
    ErrorKind.TRIAL_PENDING: -32008,
    ErrorKind.DEVICE_ABORT: -32010,
    ErrorKind.DEVICE_TIMEOUT: -32011,
    ErrorKind.MISMATCH: -32012,
    ErrorKind.ROLLED_BACK: -32013,
    ErrorKind.ROLLBACK_FAILED: -32014,
    ErrorKind.UNAVAILABLE: -32015,
    ErrorKind.STOPPED: -32016,
}


class ErrorData(Struct, frozen=True, omit_defaults=True):
    """The `data` of an error. `object` is written `"0x6065:0"`; `outcome` says what became of each name."""

    kind: ErrorKind
    component: str | None = None
    object: str | None = None
    abort_code: int | None = None
    limit: float | None = None
    outcome: dict[str, str] | None = None


class ErrorBody(Struct, frozen=True):
    """The `error` of a response."""

    code: int
    message: str
    data: ErrorData | None = None


class RpcError(Exception):
    """A request that is answered with an error; its text says what to do about it."""

    def __init__(self, message: str, data: ErrorData, code: int | None = None) -> None:
        super().__init__(message)
        self.data = data
        self.code = CODES[data.kind] if code is None else code

    @property
    def kind(self) -> ErrorKind:
        return self.data.kind

    @property
    def body(self) -> ErrorBody:
        return ErrorBody(self.code, str(self), self.data)


def refuse(kind: ErrorKind, message: str, **data: Any) -> RpcError:
    """Return an error of that kind; `data` are further fields of `ErrorData`."""
    return RpcError(message, ErrorData(kind, **data))


def unknown_method(name: str) -> RpcError:
    """Return the error for an unknown method (−32601)."""
    return RpcError(f"there is no method {name!r}", ErrorData(ErrorKind.UNKNOWN_NAME), METHOD_NOT_FOUND)


def internal_error(method: str, error: Exception) -> RpcError:
    """Return the error for a failure of the gateway itself (−32603)."""
    message = f"{method} failed inside the gateway: {type(error).__name__}: {error}; its log says more"
    return RpcError(message, ErrorData(ErrorKind.UNAVAILABLE), INTERNAL_ERROR)


class BadLine(RpcError):
    """A line that holds no request; `id` is what could still be read of it."""

    def __init__(self, message: str, code: int = INVALID_REQUEST, id: Id = None) -> None:  # noqa: A002
        super().__init__(message, ErrorData(ErrorKind.BAD_PARAMS), code)
        self.id = id


class StopRequest(Struct, frozen=True):
    """A `robot.stop`, whatever its form was; `id` is unset where nobody waits for an answer."""

    reason: str = ""
    id: Id | float | UnsetType = None


Line = bytes | BadLine | StopRequest


def size(line: Line) -> int:
    """Return the number of its bytes in memory."""
    return len(line) if isinstance(line, bytes) else 0


class LineSplitter:
    """Cuts a byte stream into lines and never holds more than `limit` bytes of one.

    A longer line is dropped up to its newline and reported once, in its place, as a `BadLine`.
    Empty lines are skipped; a carriage return before the newline belongs to the newline.
    """

    def __init__(self, limit: int = LINE_LIMIT) -> None:
        self.limit = limit
        self.too_long = 0  # lines dropped for their length
        self._rest = bytearray()
        self.dropping = False  # the rest of a line that is too long

    def feed(self, data: bytes) -> list[Line]:
        """Return the lines that `data` completes, in order."""
        lines: list[Line] = []
        *ended, rest = data.split(b"\n")
        whole = ended if self._rest or self.dropping else filter(None, ended)  # blank lines cost nothing
        for piece in whole:
            if self._rest or self.dropping or len(piece) > self.limit:
                self._add(piece, lines)
                self._end_line(lines)
            elif line := piece.removesuffix(b"\r"):  # whole, as nearly all are
                self._take(line, lines)
        if rest:
            self._add(rest, lines)
        return lines

    def end(self) -> list[Line]:
        """Return the last line, where the stream ended without a newline."""
        lines: list[Line] = []
        self._end_line(lines)
        return lines

    def _add(self, piece: bytes, lines: list[Line]) -> None:
        if self.dropping:
            self._drop(piece, lines)
            return
        self._rest += piece
        # The one byte more is room for a carriage return.
        if len(self._rest) > self.limit + self._rest.endswith(b"\r"):
            self.dropping = True
            self.too_long += 1
            self._begin_dropping(lines)
            self._drop(bytes(self._rest), lines)
            self._rest.clear()

    def _end_line(self, lines: list[Line]) -> None:
        line = bytes(self._rest).removesuffix(b"\r")
        self._rest.clear()
        if self.dropping:
            self.dropping = False
            self._end_dropping(lines)
        elif line:
            self._take(line, lines)

    # What is made of a line, and of one that is too long

    def _take(self, line: bytes, lines: list[Line]) -> None:
        lines.append(line)

    def _begin_dropping(self, lines: list[Line]) -> None:
        lines.append(BadLine(f"a line may be {self.limit} bytes long; this one is longer and was dropped"))

    def _drop(self, piece: bytes, lines: list[Line]) -> None:
        """Nothing is kept of it."""

    def _end_dropping(self, lines: list[Line]) -> None:
        """Mark it as reported."""


class Request(Struct, frozen=True, forbid_unknown_fields=True):
    """A request, or a notification where `id` is unset. `params` stay undecoded until the method is known."""

    jsonrpc: Literal["2.0"]
    method: str
    params: Raw | UnsetType = UNSET
    id: Id | UnsetType = UNSET


class Notification(Struct, frozen=True):
    """A message that nobody answers, as a client reads it."""

    jsonrpc: Literal["2.0"]
    method: str
    params: Raw = Raw(b"{}")


class _Outgoing(Struct, frozen=True):
    id: Id | float | UnsetType = UNSET
    method: str | UnsetType = UNSET
    params: Any = UNSET
    result: Any = UNSET
    error: ErrorBody | UnsetType = UNSET
    jsonrpc: Literal["2.0"] = "2.0"


_encoder = msgspec.json.Encoder()
_request_decoder = msgspec.json.Decoder(Request)


def _line(message: _Outgoing) -> bytes:
    return _encoder.encode(message) + b"\n"


def encode_request(id: Id, method: str, params: object = UNSET) -> bytes:  # noqa: A002
    """One request as a line."""
    return _line(_Outgoing(id=id, method=method, params=params))


def encode_result(id: Id | float, result: object) -> bytes:  # noqa: A002
    """One successful answer as a line."""
    return _line(_Outgoing(id=id, result=result))


def encode_answers(ids: Sequence[Id | float], answer: object) -> list[bytes]:
    """One answer, or one `RpcError`, to each of these requests."""
    if isinstance(answer, RpcError):
        return [encode_error(id_, answer) for id_ in ids]
    if len(ids) > 1:
        answer = msgspec.Raw(_encoder.encode(answer))  # once for all
    return [encode_result(id_, answer) for id_ in ids]


def encode_error(id: Id | float, error: RpcError) -> bytes:  # noqa: A002
    """One error as a line."""
    return _line(_Outgoing(id=id, error=error.body))


def encode_notification(method: str, params: object) -> bytes:
    """One notification as a line."""
    return _line(_Outgoing(method=method, params=params))


def decode_request(line: bytes) -> Request:
    """One line as a request.

    Raises:
        BadLine: what the line holds is no JSON (−32700) or no single request (−32600).

    """
    try:
        if not line.isascii():
            line.decode()
        request = _request_decoder.decode(line)
        _strict.decode(line.decode())
    except (ValueError, RecursionError) as error:
        raise _explain(line, error) from error
    return request


class _Ambiguous(ValueError):
    """JSON that another reader may take for something else."""


def _once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    found: dict[str, object] = {}
    for key, value in pairs:
        if key in found:
            raise _Ambiguous(f"the key {key[:NAME_LENGTH]!r} stands in it twice")
        found[key] = value
    return found


def _in_64_bits(digits: str) -> int:
    if len(digits) > 20 or not -(2**63) <= int(digits) < 2**64:
        raise _Ambiguous(f"an integer of {len(digits)} digits is more than 64 bits hold")
    return int(digits)


_strict = json.JSONDecoder(object_pairs_hook=_once, parse_int=_in_64_bits)


def encode_refusal(line: bytes | BadLine, refusal: RpcError) -> bytes:
    """Return the answer to a line that is refused; nothing if it needs no answer."""
    try:
        if isinstance(line, BadLine):
            raise line
        id_ = decode_request(line).id
    except BadLine as error:
        return encode_error(error.id, error)
    return b"" if isinstance(id_, UnsetType) else encode_error(id_, refusal)


def _explain(line: bytes, error: Exception) -> BadLine:
    """Return the slow way, taken only by what is no request: find out why, and whose it was."""
    if isinstance(error, _Ambiguous):
        return BadLine(f"this is no request: {error}", PARSE_ERROR)
    try:
        found = msgspec.json.decode(line.decode())
    except RecursionError:
        return BadLine("the message is nested too deeply", PARSE_ERROR)
    except (msgspec.DecodeError, UnicodeDecodeError) as reason:
        return BadLine(f"this cannot be read as JSON: {reason}", PARSE_ERROR)
    if isinstance(found, list):
        return BadLine("batches are not supported: send one request a line")
    if not isinstance(found, dict):
        return BadLine('a request is an object: {"jsonrpc": "2.0", "id": 1, "method": "…", "params": {…}}')
    known = found.get("id")
    usable = isinstance(known, str) or (isinstance(known, int) and not isinstance(known, bool))
    return BadLine(f"not a JSON-RPC 2.0 request: {plainly(error)}", id=known if usable else None)


_Params = TypeVar("_Params", bound=Struct)


def decode_params(raw: Raw | UnsetType, type: type[_Params]) -> _Params:  # noqa: A002
    """Return the parameters of a request as the method's own struct.

    Raises:
        RpcError: −32602; the message names the field and what is allowed.

    """
    encoded = b"{}" if raw is UNSET else bytes(raw)
    if encoded == b"null":
        encoded = b"{}"
    if encoded.startswith(b"["):
        raise refuse(ErrorKind.BAD_PARAMS, "parameters go by name: send an object, not a list")
    try:
        return msgspec.json.decode(encoded, type=type)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        allowed = ", ".join(type.__struct_encode_fields__) or "none"
        raise refuse(ErrorKind.BAD_PARAMS, f"{plainly(error)} (parameters here: {allowed})") from error
