"""Rows of the table of labels, as other programs may have written them."""

from datetime import UTC, datetime

import pytest

from ml.store import StoreError
from ml.store.labels import Label, LabelSource

ROW = {
    "robot": "exo-01",
    "session": "s-1",
    "utc": datetime(2026, 11, 21, 15, 30, tzinfo=UTC),
    "ended": datetime(2026, 11, 21, 15, 31, tzinfo=UTC),
    "label": "walk",
    "author": None,
    "source": "person",
}


def test_a_row_is_a_label() -> None:
    label = Label.of(ROW)
    assert (label.label, label.author, label.source) == ("walk", "", LabelSource.PERSON)
    assert label.ended_utc_ns - label.began_utc_ns == 60 * 10**9


def test_a_source_that_nobody_knows_is_named_with_the_label() -> None:
    with pytest.raises(
        StoreError, match="'walk' of session s-1 of exo-01 has the source 'oracle'; known are person"
    ):
        Label.of({**ROW, "source": "oracle"})
