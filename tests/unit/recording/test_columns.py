"""Each channel has a column of its own in the store, whatever robots and channels are called."""

from pathlib import Path

import pyarrow as pa
import pyarrow.dataset
import pytest

from ml.store import Store, StoreError
from ml.store.tables import TELEMETRY, field
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from tests.unit.recording.robots import batch, described, value

HERE = TELEMETRY.location("exo-01", 1)


def upload_all(spool: Spool, store: Store) -> None:
    for number in spool.waiting():
        send(spool, number, store)


@pytest.mark.parametrize(
    "batches",
    [
        ({"knee": "deg", "knee@deg": "deg"}, {"knee@deg": "deg", "knee": "deg"}),
        ({"knee@deg": "deg"}, {"knee": "deg"}, {"knee@deg": "deg", "knee": "deg"}),
        ({"row": "rad", "row@rad": "rad"}, {"row@rad": "rad"}, {"row": "rad"}),
        ({"row": "", "row@2": "", "row@": ""}, {"row@2": "", "row@": "", "row": ""}),
    ],
)
def test_two_channels_never_share_a_column_and_each_keeps_its_own(
    spool: Spool, folder_url: str, batches: tuple[dict[str, str], ...]
) -> None:
    """Where one has the name that the other's column has, because of a unit or of the table's own columns."""
    store = Store(folder_url)
    with Recorder(spool) as recorder:
        recorder.describe("exo-02", described("exo-02", {"knee": "rad"}))
        recorder.record("exo-02", 1, batch(0, channels=("knee",)))
    upload_all(spool, store)
    expected: dict[str, list[float]] = {}
    for seq, units in enumerate(batches):
        with Recorder(spool) as recorder:
            recorder.describe("exo-01", described("exo-01", units))
            recorder.record("exo-01", 1, batch(seq, channels=tuple(units)))
        upload_all(spool, store)
        for column, name in enumerate(units):
            expected.setdefault(name, []).append(value(seq, 0, column))
    rows = store.dataset(HERE).to_table(filter=pyarrow.dataset.field("robot") == "exo-01").sort_by("seq")
    columns = rows.drop_columns(TELEMETRY.schema.names).to_pydict()
    found = sorted([each for each in column if each is not None] for column in columns.values())
    assert [each for each in found if each] == sorted(expected.values())


def test_a_column_that_another_has_just_added_for_another_channel_is_refused(folder_url: str) -> None:
    def append(store: Store, channel: str, number: int) -> None:
        added = [field("row@rad", pa.float64(), "rad", channel)] if number > 1 else []
        empty = pa.schema([*TELEMETRY.schema, *added]).empty_table()
        store.append(TELEMETRY, HERE, empty.schema, lambda: iter(empty.to_batches()), channel, number)

    stores = {channel: Store(folder_url) for channel in ("row", "row@rad")}
    for channel, store in stores.items():
        append(store, channel, 1)  # both have the table open now
    append(stores["row"], "row", 2)
    with pytest.raises(StoreError, match="has row in the column row@rad, to which row@rad was to be written"):
        append(stores["row@rad"], "row@rad", 2)


def test_a_column_that_another_collector_has_just_made_in_another_unit_costs_no_upload(
    tmp_path: Path, folder_url: str
) -> None:
    stores = {unit: Store(folder_url) for unit in ("deg", "rad")}
    for channel in ("hip", "knee"):  # of the knee, neither table that they have open knows anything
        for unit, store in stores.items():
            with Spool(tmp_path / unit, reserve_bytes=0) as spool:
                with Recorder(spool) as recorder:
                    units = {channel: unit if channel == "knee" else "rad"}
                    recorder.describe("exo-01", described("exo-01", units))
                    recorder.record("exo-01", 1, batch(0, channels=(channel,)))
                upload_all(spool, store)
    assert Store(folder_url).dataset(HERE).schema.names[-3:] == ["hip", "knee", "knee@rad"]
