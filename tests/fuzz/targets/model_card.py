"""A model's card."""

import msgspec

from ml.errors import UnusableModel
from ml.registry import card

TOKENS = (
    b'"id":"',
    b'"made":"2026-01-02T03:04:05Z"',
    b'"format":1',
    b'"source":"simulated"',
    b'"metrics":{',
    b"NaN",
    b"1e999",
)
MODULES = ("ml.registry.card",)


def fuzz(data: bytes) -> None:
    try:
        found = card.decoded(data)
    except UnusableModel:
        _as_published(data)
        return
    assert card.decoded(card.encoded(found)) == found
    card.age_days(found)


def _as_published(data: bytes) -> None:
    """Whatever a card says, with the id that is right for it."""
    try:
        draft = msgspec.json.decode(data, type=card.Card)
    except (ValueError, RecursionError):
        return
    draft = msgspec.structs.replace(draft, format=card.FORMAT)
    named = msgspec.structs.replace(draft, id=card.content_id(draft))
    assert card.decoded(card.encoded(named)) == named
    card.age_days(named)
