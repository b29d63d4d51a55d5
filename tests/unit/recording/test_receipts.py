"""A spool with damaged receipts or `id` is opened and recorded into, and tells nothing that is not so."""

from collections.abc import Callable
from pathlib import Path

import pytest

from ml.store import Store
from server_gui.core.recording.receipts import RECEIPTS
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.spool_files import identity
from server_gui.core.recording.upload import lost_batches, send
from server_gui.core.recording.uploader import Uploader
from tests.support.waiting import until
from tests.unit.recording.robots import batch


def recorded(folder: Path, store: Store, batches: int = 3) -> None:
    """So many batches, each in the store and with its receipt."""
    for seq in range(batches):
        with Spool(folder, reserve_bytes=0) as spool:
            with Recorder(spool) as recorder:
                recorder.record("exo-01", 1, batch(seq))
            for number in spool.waiting():
                send(spool, number, store)


def a_bit_of_a_name(line: bytes) -> bytes:
    return line.replace(b"exo-01", b"\xe5xo-01")


def the_batch(line: bytes) -> bytes:
    return line.replace(b'"batch":3', b'"batch":7')


def the_crc(line: bytes) -> bytes:
    return line.replace(b'"crc":"', b'"crc":"\xff', 1)


def the_beginning(line: bytes) -> bytes:
    return b"\x00" * len(line)


def the_end(line: bytes) -> bytes:
    return line[:-2] + b"\xff\n"


DAMAGES = (a_bit_of_a_name, the_batch, the_crc, the_beginning, the_end)


def damage_newest(folder: Path, damage: Callable[[bytes], bytes]) -> None:
    *lines, last = (folder / RECEIPTS).read_bytes().splitlines(keepends=True)
    (folder / RECEIPTS).write_bytes(b"".join([*lines, damage(last)]))


@pytest.mark.parametrize("damage", DAMAGES)
def test_where_the_newest_receipt_is_damaged_recording_goes_on_and_no_loss_is_told(
    tmp_path: Path, folder_url: str, damage: Callable[[bytes], bytes]
) -> None:
    store = Store(folder_url)
    recorded(tmp_path, store)
    damage_newest(tmp_path, damage)
    with Spool(tmp_path, reserve_bytes=0) as spool:
        assert (spool.missing, spool.first) == (None, 4)
        newest = spool.receipts.newest()
        assert newest is not None
        assert newest.batch == 2
        assert lost_batches(spool, store) == []
    recorded(tmp_path, store, 1)
    with Spool(tmp_path) as spool:
        found = spool.receipts.newest()
        assert found is not None
        assert found.batch == 4
    assert "events" not in {each.split("/")[0] for each in store.objects.names("")}


def test_a_batch_whose_receipt_may_be_the_damaged_one_is_an_alarm_and_no_loss(
    tmp_path: Path, folder_url: str
) -> None:
    store = Store(folder_url)
    recorded(tmp_path, store)
    damage_newest(tmp_path, the_batch)
    for file in tmp_path.glob("0*.uploaded.db*"):  # as when room is made
        file.unlink()
    with Spool(tmp_path, reserve_bytes=0) as spool:
        assert lost_batches(spool, store) == []
        with Uploader(spool, lambda: store) as uploader:
            until(lambda: uploader.state.lost)
        [told] = uploader.state.lost
        assert f"line 3 of its {RECEIPTS} is damaged: nobody can say whether they were uploaded" in told


def test_receipts_longer_than_what_is_read_at_first_are_read_to_their_last_line(
    tmp_path: Path, folder_url: str
) -> None:
    store = Store(folder_url)
    recorded(tmp_path, store, 1)
    with Spool(tmp_path) as spool:
        receipt = spool.receipts.newest()
        assert receipt is not None
        for words in (1 << 18, 1 << 18, 1, 1):  # 1.5 MiB a line
            spool.receipts.add(type(receipt)(receipt.writer, words, receipt.url, (), ("lost " * words,)))
            found = spool.receipts.newest()
            assert found is not None
            assert found.batch == words


@pytest.mark.parametrize("content", [b"", b"xx\n", b"\xff\n", None])
@pytest.mark.parametrize("known_by", ["receipts", "batches", "nobody"])
def test_a_damaged_id_is_said_and_the_spool_keeps_its_name_where_anything_tells_it(
    tmp_path: Path, folder_url: str, content: bytes | None, known_by: str
) -> None:
    recorded(tmp_path, Store(folder_url))
    before = identity(tmp_path)
    gone = {"receipts": "0*.db*", "batches": RECEIPTS, "nobody": "*.*"}[known_by]
    for file in tmp_path.glob(gone):
        file.unlink()
    (tmp_path / "id").unlink()
    if content is not None:
        (tmp_path / "id").write_bytes(content)
    with Spool(tmp_path, reserve_bytes=0) as spool:
        assert (spool.id == before) == (known_by != "nobody")
        assert identity(tmp_path) == spool.id
        said = bool(spool.notices)
    assert said == (content is not None or known_by != "nobody")
    with Spool(tmp_path, reserve_bytes=0) as spool:
        assert spool.notices == []
