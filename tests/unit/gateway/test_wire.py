"""The wire: framing at every split, envelopes, error codes; nothing a peer sends can raise anything else."""

import contextlib
import json
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.wire import framing
from gateway.wire.methods import METHODS


def split(data: bytes, at: list[int], limit: int = 16) -> list[framing.Line]:
    splitter = framing.LineSplitter(limit)
    found: list[framing.Line] = []
    for start, end in zip([0, *at], [*at, len(data)], strict=True):
        found += splitter.feed(data[start:end])
    return found + splitter.end()


def plain(lines: list[framing.Line]) -> list[framing.Line | str]:
    return [str(line) if isinstance(line, framing.BadLine) else line for line in lines]


@pytest.mark.parametrize(
    ("data", "lines"),
    [
        (b"", []),
        (b"\n\n\r\n", []),
        (b"a\nb\r\nc", [b"a", b"b", b"c"]),
        (b"a" * 16 + b"\n", [b"a" * 16]),
        (b"a" * 16 + b"\r\n", [b"a" * 16]),
        (b"a" * 17 + b"\nb\n", ["a line may be 16 bytes long; this one is longer and was dropped", b"b"]),
        (b"a" * 100, ["a line may be 16 bytes long; this one is longer and was dropped"]),
    ],
)
def test_lines_come_out_alike_at_every_split_point(data: bytes, lines: list[bytes | str]) -> None:
    for cut in range(len(data) + 1):
        assert plain(split(data, [cut])) == lines


@given(st.lists(st.binary(max_size=24), max_size=6), st.data())
def test_splitting_never_depends_on_how_bytes_arrive(pieces: list[bytes], data: st.DataObject) -> None:
    stream = b"\n".join(pieces)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=5)))
    assert plain(split(stream, cuts)) == plain(split(stream, []))


def test_a_splitter_holds_no_more_than_its_limit() -> None:
    splitter = framing.LineSplitter(limit=100)
    for _ in range(1000):
        splitter.feed(b"x" * 50)
        assert len(splitter._rest) <= 100
    assert splitter.too_long == 1


@pytest.mark.parametrize(
    ("line", "code", "id_"),
    [
        (b"{", framing.PARSE_ERROR, None),
        (b"\xff\xfe", framing.PARSE_ERROR, None),
        (b'{"jsonrpc":"2.0","id":1,"method":"x","params":{"a":"\xff"}}', framing.PARSE_ERROR, None),
        (b'{"jsonrpc":"2.0","id":1,"method":"x","params":{"a":NaN}}', framing.PARSE_ERROR, None),
        (b'{"jsonrpc":"2.0","id":1,"method":"x","params":' + b"[" * 30000 + b"}", framing.PARSE_ERROR, None),
        (b'[{"jsonrpc":"2.0","id":1,"method":"x"}]', framing.INVALID_REQUEST, None),
        (b"7", framing.INVALID_REQUEST, None),
        (b'{"jsonrpc":"1.0","id":1,"method":"x"}', framing.INVALID_REQUEST, 1),
        (b'{"jsonrpc":"2.0","id":"a","method":5}', framing.INVALID_REQUEST, "a"),
        (b'{"jsonrpc":"2.0","id":[1],"method":"x"}', framing.INVALID_REQUEST, None),
        (b'{"jsonrpc":"2.0","id":true,"method":"x"}', framing.INVALID_REQUEST, None),
        (b'{"jsonrpc":"2.0","id":4,"method":"x","parms":{}}', framing.INVALID_REQUEST, 4),
        (b'{"id":4,"method":"x"}', framing.INVALID_REQUEST, 4),
    ],
)
def test_what_is_no_request_is_named_and_keeps_its_id(line: bytes, code: int, id_: framing.Id) -> None:
    with pytest.raises(framing.BadLine) as caught:
        framing.decode_request(line)
    assert (caught.value.code, caught.value.id) == (code, id_)


@given(st.binary(max_size=200))
def test_no_line_raises_anything_but_bad_line(line: bytes) -> None:
    with contextlib.suppress(framing.BadLine):
        framing.decode_request(line)


@pytest.mark.parametrize(
    ("method", "params", "says"),
    [
        ("component.snapshot", b"[]", "by name"),
        ("component.snapshot", b'"x"', "must be an object, not text"),
        ("component.snapshot", b'{"chanels":[]}', "there is no chanels here (parameters here: channels)"),
        ("stream.start", b'{"modules":["component"],"rate_hz":1001}', "rate_hz must be a number, at most"),
        ("stream.start", b'{"modules":["component"],"rate_hz":1e999}', "out of range"),
        ("stream.start", b'{"modules":[],"rate_hz":1}', "modules must not be empty"),
        ("stream.start", b'{"modules":["motor"],"rate_hz":1}', "motor"),
        ("control.acquire", b'{"ttl_s":301}', "at most 300"),
        ("control.acquire", b"{}", "ttl_s"),
        ("parameter.write", b'{"changes":{}}', "changes must not be empty"),
        ("parameter.write", b'{"changes":{"a":true}}', "not true or false"),
        ("clock.read", b'{"a":1}', "parameters here: none"),
    ],
)
def test_wrong_parameters_name_the_field_and_what_is_allowed(method: str, params: bytes, says: str) -> None:
    with pytest.raises(framing.RpcError) as caught:
        framing.decode_params(msgspec.Raw(params), METHODS[method].params)
    assert (caught.value.code, caught.value.kind) == (framing.INVALID_PARAMS, framing.ErrorKind.BAD_PARAMS)
    assert says in str(caught.value)


@pytest.mark.parametrize("params", [b"", b"null", b'{"reason":7}', b'{"why":"fire"}'])
def test_a_stop_is_never_refused_for_its_form(params: bytes) -> None:
    raw = msgspec.Raw(params) if params else msgspec.UNSET
    framing.decode_params(raw, METHODS["robot.stop"].params)


@given(st.one_of(st.none(), st.integers(), st.text()), st.floats())
def test_messages_are_one_line_and_numbers_that_are_none_are_null(id_: framing.Id, number: float) -> None:
    line = framing.encode_result(id_, {"x": number})
    assert line.count(b"\n") == 1
    found: dict[str, Any] = json.loads(line)
    assert found["id"] == id_
    finite = number - number == 0
    assert found["result"]["x"] == (number if finite else None)


def test_an_error_carries_kind_code_and_only_what_applies() -> None:
    error = framing.refuse(
        framing.ErrorKind.OUT_OF_LIMIT, "too far", component="gait", object="0x2001:0", limit=0.6
    )
    found = json.loads(framing.encode_error(3, error))
    assert found == {
        "jsonrpc": "2.0",
        "id": 3,
        "error": {
            "code": -32005,
            "message": "too far",
            "data": {"kind": "out_of_limit", "component": "gait", "object": "0x2001:0", "limit": 0.6},
        },
    }


def test_every_kind_has_a_code_of_its_own() -> None:
    assert set(framing.CODES) == set(framing.ErrorKind)
    assert len(set(framing.CODES.values())) == len(framing.CODES)
