"""Predictions during a recording, from the store and from pending batches of the spool."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import msgspec
import pyarrow.dataset

from ml.serving.predictor import Prediction
from ml.store import Store, reading
from ml.store.labels import utc_ns
from ml.store.sessions import Session
from ml.store.tables import PREDICTIONS
from ml.store.translation import translated
from server_gui.core.cloud import spool_reader
from server_gui.core.cloud.tape import as_time
from server_gui.core.settings.server_file import ServerSettings

_numbers = msgspec.json.Decoder(dict[str, float])


@dataclass(frozen=True, slots=True)
class PastPrediction:
    """A model's prediction for the window that ended at `utc_ns`."""

    utc_ns: int
    prediction: Prediction


def said(settings: ServerSettings, session: Session, begin_ns: int, end_ns: int) -> list[PastPrediction]:
    """Return the predictions from `begin_ns` up to before `end_ns`, in time's order; blocks.

    Raises:
        StoreError: the store cannot be reached, or the table not be read.
        SpoolUnusable: what waits cannot be read.

    """
    rows = list(_waiting(settings, session))  # before the store: what is uploaded meanwhile is in both
    if session.uploaded:
        rows += _stored(settings, session, begin_ns, end_ns)
    found = [_said(row) for row in rows]
    once = {(one.utc_ns, one.prediction.task): one for one in found if begin_ns <= one.utc_ns < end_ns}
    return [once[key] for key in sorted(once)]


def _waiting(settings: ServerSettings, session: Session) -> Iterator[Mapping[str, Any]]:
    for row in spool_reader.rows(settings.recorder.spool, PREDICTIONS):
        if (row["robot"], row["session"]) == (session.robot, session.session):
            yield row


def _stored(
    settings: ServerSettings, session: Session, begin_ns: int, end_ns: int
) -> list[Mapping[str, Any]]:
    store, column = Store.existing(settings.store.url), pyarrow.dataset.field
    of_session = (column("robot") == session.robot) & (column("session") == session.session)
    within = (column("utc") >= as_time(begin_ns)) & (column("utc") < as_time(end_ns))
    with translated(f"{store.url}/{PREDICTIONS.name} cannot be read"):
        table = reading.dataset(store, PREDICTIONS).to_table(filter=of_session & within)
        found: list[Mapping[str, Any]] = table.to_pylist()
    return found


def _said(row: Mapping[str, Any]) -> PastPrediction:
    names = ("task", "model", "stamp_ns", "label", "probability", "novelty")
    tables = (_numbers.decode(row[name]) for name in ("probabilities", "values"))
    return PastPrediction(utc_ns(row["utc"]), Prediction(*(row[name] for name in names), *tables))
