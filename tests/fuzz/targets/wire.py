"""What a client may send to the gateway: lines out of bytes, requests and their parameters out of lines."""

from gateway.wire import framing
from gateway.wire.messages import METHODS, StopParams

TOKENS = (
    b'{"jsonrpc":"2.0","id":1,"method":"',
    b'"params":{',
    b"\r\n",
    b"\n",
    b"null",
    b"[[[[",
    b"1e400",
    b"\\u0000",
    *(f'"{name}"'.encode() for name in METHODS),
)
MODULES = ("gateway.wire.framing",)
LIMIT = 64


def fuzz(data: bytes) -> None:
    lines = _split(framing.LineSplitter(LIMIT), [data])
    assert lines == _split(framing.LineSplitter(LIMIT), [data[at : at + 1] for at in range(len(data))])
    assert all(len(line) <= LIMIT for line in lines if isinstance(line, bytes))
    for line in data.split(b"\n"):
        _decode(line)


def _split(splitter: framing.LineSplitter, pieces: list[bytes]) -> list[bytes | str]:
    lines = [line for piece in pieces for line in splitter.feed(piece)] + splitter.end()
    return [line if isinstance(line, bytes) else str(line) for line in lines]


def _decode(line: bytes) -> None:
    try:
        request = framing.decode_request(line)
    except framing.BadLine as error:
        answer = framing.encode_error(error.id, error)
        assert answer.endswith(b"\n")
        assert answer.count(b"\n") == 1
        return
    method = METHODS.get(request.method)
    try:
        framing.decode_params(request.params, StopParams if method is None else method.params)
    except framing.RpcError as error:
        assert framing.encode_error(None, error).count(b"\n") == 1
