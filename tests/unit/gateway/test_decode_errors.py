"""What is wrong with a value, in words: for every constraint that our messages and files have."""

from enum import StrEnum
from typing import Annotated, Any

import msgspec
import pytest
from msgspec import Meta, Struct

from gateway.decode_errors import plainly


class _Colour(StrEnum):
    RED = "red"


class _Inner(Struct):
    low: int | float | None = None


class _All(Struct, forbid_unknown_fields=True):
    must: bool
    name: Annotated[str, Meta(max_length=3, min_length=1)] = "a"
    rate: Annotated[float, Meta(gt=0, le=5)] = 1.0
    count: Annotated[int, Meta(ge=1, lt=9)] = 1
    colour: _Colour = _Colour.RED
    items: Annotated[list[int], Meta(max_length=2, min_length=1)] = msgspec.field(default_factory=lambda: [1])
    inner: _Inner = msgspec.field(default_factory=_Inner)
    made: dict[str, float] = {}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "must is missing"),
        ({"other": 1}, "there is no other here"),
        ({"a - at `b": 1}, "there is no a - at `b here"),
        ({"count": 1.5}, "count must be a whole number, not a fraction"),
        ({"must": 1}, "must must be true or false, not a whole number"),
        ({"name": "abcd"}, "name has more than 3 characters"),
        ({"name": ""}, "name must not be empty"),
        ({"name": 5}, "name must be text, not a whole number"),
        ({"rate": "x"}, "rate must be a number, not text"),
        ({"rate": 0}, "rate must be a number above 0"),
        ({"rate": 6}, "rate must be a number, at most 5"),
        ({"count": 0}, "count must be a whole number, at least 1"),
        ({"count": 9}, "count must be a whole number, at most 8"),
        ({"colour": "blue"}, "colour 'blue' is not known"),
        ({"items": [1, 2, 3]}, "items has more than 2 entries"),
        ({"items": []}, "items must not be empty"),
        ({"items": [1, "x"]}, "items[1] must be a whole number, not text"),
        ({"items": {}}, "items must be a list, not an object"),
        ({"inner": {"low": []}}, "inner.low must be a number, not a list"),
        ({"inner": None}, "inner must be an object, not nothing"),
        ({"made": {"a": True}}, "made[...] must be a number, not true or false"),
    ],
)
def test_each_refusal_is_said_in_words(given: dict[str, Any], said: str) -> None:
    whole = given if said.startswith(("must", "there")) else {"must": True, **given}
    with pytest.raises(msgspec.ValidationError) as refused:
        msgspec.json.decode(msgspec.json.encode(whole), type=_All)
    assert plainly(refused.value) == said


def test_what_is_not_known_stays_as_it_is() -> None:
    assert plainly(ValueError("JSON is malformed: expected ':' (byte 5)")) == (
        "JSON is malformed: expected ':' (byte 5)"
    )
