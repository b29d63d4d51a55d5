"""A log that a power cut has torn: what was acknowledged is there, and what was not is appended once."""

import os
import shutil
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from urllib.parse import urlsplit

import pyarrow as pa
import pytest

from ml.store import Store, StoreError, durable, torn, upkeep
from ml.store.durable import LOG
from ml.store.tables import EVENTS

WRITER = "spool"
EVERY = datetime(2026, 1, 1, tzinfo=UTC)
S = 10**9
LONG_AGO_S = 1_000.0


def row(number: int) -> pa.Table:
    return EVENTS.rows([{"robot": "exo-01", "session": "s", "utc": number * S, "text": str(number)}])


def append(url: str, number: int) -> bool:
    """As an uploader does that has been started."""
    found = row(number)
    return Store(url).append(
        EVENTS, EVENTS.name, found.schema, lambda: iter(found.to_batches()), WRITER, number
    )


def texts(url: str) -> list[int]:
    found = Store(url).dataset(EVENTS.name).to_table(columns=["text"])
    return sorted(map(int, found["text"].to_pylist()))


def log_of(url: str) -> Path:
    return Path(urlsplit(url).path) / EVENTS.name / LOG


def entry(url: str, version: int) -> Path:
    return log_of(url) / f"{version:020}.json"


def cut(file: Path, data: bytes) -> None:
    """As a power cut some while ago left it: another file, without the mark of one that lasts."""
    file.unlink(missing_ok=True)
    file.write_bytes(data)
    os.utime(file, (file.stat().st_mtime - LONG_AGO_S,) * 2)


@pytest.fixture
def url(folder_url: str) -> str:
    for number in (1, 2, 3):
        assert append(folder_url, number)
    return folder_url


def test_an_append_that_is_cut_at_any_length_is_made_once(url: str) -> None:
    data = entry(url, 3).read_bytes()
    assert not any(torn.whole(data[:length]) for length in range(len(data)))
    ends = [at for at in range(len(data)) if data[at : at + 1] == b"\n"]
    for length in sorted({*ends, *(end + 1 for end in ends), *range(0, len(data), 613), len(data) - 1}):
        cut(entry(url, 3), data[:length])
        assert append(url, 3), length
        assert texts(url) == [1, 2, 3], length
    assert not append(url, 3)
    assert len(list(log_of(url).glob("*.torn*"))) > len(ends)


def _lengths(data: bytes) -> list[int]:
    """Every end of a line, with and without it, and what lies between at intervals."""
    ends = [at for at in range(len(data)) if data[at : at + 1] == b"\n"]
    return sorted({*ends, *(end + 1 for end in ends), *range(0, len(data), 613)} - {len(data)})


def test_a_table_whose_making_is_cut_at_any_length_is_made_anew(url: str) -> None:
    for version in (1, 2, 3):
        entry(url, version).unlink()
    data = entry(url, 0).read_bytes()
    for length in _lengths(data):
        cut(entry(url, 0), data[:length])
        assert append(url, 1), length
        assert texts(url) == [1], length
        entry(url, 1).unlink()


@pytest.mark.parametrize(
    ("tidied", "left"),
    [
        (lambda store: upkeep.compact(store, [EVENTS]), [1, 2, 3]),
        (lambda store: upkeep.retain(store, [EVENTS], datetime(1970, 1, 1, 0, 0, 2, tzinfo=UTC)), [2, 3]),
    ],
)
def test_tidying_that_is_cut_anywhere_neither_loses_nor_doubles(
    url: str, tidied: Callable[[Store], object], left: list[int]
) -> None:
    tidied(Store(url))
    for checkpoint in (*log_of(url).glob("*.parquet"), log_of(url) / "_last_checkpoint"):
        checkpoint.unlink()
    data = entry(url, 4).read_bytes()
    for length in _lengths(data):
        cut(entry(url, 4), data[:length])
        Store(url).mend(EVENTS.name)
        assert texts(url) == [1, 2, 3], length
    cut(entry(url, 4), data)
    Store(url).mend(EVENTS.name)
    assert texts(url) == left


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.99])
def test_a_checkpoint_that_is_cut_costs_nothing(url: str, share: float) -> None:
    Store(url).table(EVENTS.name).create_checkpoint()
    [file] = log_of(url).glob("*.checkpoint.parquet")
    cut(file, file.read_bytes()[: int(share * file.stat().st_size)])
    with pytest.raises(StoreError, match=r"checkpoint\.parquet is cut off"):
        texts(url)
    assert append(url, 4)
    assert texts(url) == [1, 2, 3, 4]


def test_a_hint_that_is_cut_costs_nothing(url: str) -> None:
    Store(url).table(EVENTS.name).create_checkpoint()
    hint = log_of(url) / "_last_checkpoint"
    data = hint.read_bytes()
    for length in (*range(0, len(data), 5), len(data) - 1):
        cut(hint, data[:length])
        assert texts(url) == [1, 2, 3]


def test_who_reads_a_torn_log_is_told_what_is_wrong_and_what_to_do(url: str) -> None:
    cut(entry(url, 3), entry(url, 3).read_bytes()[:50])
    with pytest.raises(StoreError, match=r"0003\.json is cut off.* gwrms cloud compact, sets it aside"):
        texts(url)
    upkeep.compact(Store(url), [EVENTS])
    assert texts(url) == [1, 2]


def test_an_entry_that_may_just_be_written_is_left_alone(url: str) -> None:
    data = entry(url, 3).read_bytes()[:50]
    entry(url, 3).unlink()
    entry(url, 3).write_bytes(data)
    with pytest.raises(StoreError, match="try again in 10 s"):
        append(url, 3)
    assert entry(url, 3).read_bytes() == data


def test_an_entry_that_was_acknowledged_is_never_set_aside(url: str, tmp_path: Path) -> None:
    try:
        os.setxattr(tmp_path, "user.gwrms.test", b"1")
    except OSError:
        pytest.skip("this file system has no extended attributes")
    with entry(url, 3).open("r+b") as file:  # it keeps its mark
        file.truncate(50)
    os.utime(entry(url, 3), (0, 0))
    for _ in range(2):
        with pytest.raises(StoreError, match=r"0003\.json is damaged, and was whole once"):
            append(url, 3)


def test_an_entry_in_the_middle_that_is_damaged_is_named(url: str) -> None:
    cut(entry(url, 2), entry(url, 2).read_bytes()[:50])
    for attempt in (lambda: texts(url), lambda: append(url, 4)):
        with pytest.raises(StoreError, match=r"0002\.json is damaged, and was whole once"):
            attempt()


def test_everything_that_the_library_writes_is_whole(url: str, tmp_path: Path) -> None:
    store = Store(url)
    upkeep.compact(store, [EVENTS])
    store.add(EVENTS, EVENTS.name, row(9).to_reader())
    upkeep.retain(store, [EVENTS], datetime(1970, 1, 1, 0, 0, 5, tzinfo=UTC))
    upkeep.retain(store, [EVENTS], EVERY)
    shutil.copytree(log_of(url), tmp_path / "log")
    entries = sorted((tmp_path / "log").glob("*.json"))
    assert len(entries) == 8
    assert all(torn.whole(each.read_bytes()) for each in entries)


def vacuumed(url: str) -> None:
    """A vacuum's two entries, 5 and 6, as where nobody has made them last."""
    upkeep.compact(Store(url), [EVENTS])
    upkeep.vacuum(Store(url), [EVENTS], timedelta(0))
    for version in (5, 6):
        cut(entry(url, version), entry(url, version).read_bytes())


@pytest.mark.parametrize("left", [None, b"", b'{"commitInfo', bytes(200)])
@pytest.mark.parametrize("marked", [True, False])
def test_of_two_entries_the_second_alone_may_be_left(url: str, left: bytes | None, marked: bool) -> None:
    vacuumed(url)
    for each in () if marked else log_of(url).glob("*.json"):  # a file system without attributes
        cut(each, each.read_bytes())
    if left is None:
        entry(url, 5).unlink()
    else:
        cut(entry(url, 5), left)
    assert append(url, 4)
    assert texts(url) == [1, 2, 3, 4]


def test_an_entry_in_the_middle_is_named_also_where_nothing_says_what_lasts(url: str) -> None:
    for each in log_of(url).glob("*.json"):
        cut(each, each.read_bytes())
    cut(entry(url, 1), bytes(2_000))
    with pytest.raises(StoreError, match=r"0001\.json is damaged, and was whole once"):
        append(url, 4)


def test_the_beginning_of_a_log_lasts_before_anything_follows_it(
    folder_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Store, "_commit", killed)
    with pytest.raises(KeyboardInterrupt):
        append(folder_url, 1)
    assert durable.is_marked(entry(folder_url, 0))


def test_an_entry_that_somebody_has_removed_is_named(url: str) -> None:
    entry(url, 2).unlink()
    for attempt in (lambda: texts(url), lambda: append(url, 4)):
        with pytest.raises(StoreError, match=r"0002\.json is missing, and was whole once: bring"):
            attempt()


def test_a_checkpoint_without_its_entry_is_set_aside(url: str) -> None:
    Store(url).table(EVENTS.name).create_checkpoint()
    for checkpoint in log_of(url).glob("*.parquet"):
        cut(checkpoint, checkpoint.read_bytes())
    entry(url, 3).unlink()
    assert append(url, 3)
    assert texts(url) == [1, 2, 3]
    assert not list(log_of(url).glob("*.parquet"))


def test_a_hint_at_a_checkpoint_that_is_not_there_is_set_aside(url: str) -> None:
    Store(url).table(EVENTS.name).create_checkpoint()
    for checkpoint in log_of(url).glob("*.parquet"):
        checkpoint.unlink()
    with pytest.raises(StoreError, match="_last_checkpoint is cut off"):
        texts(url)
    assert append(url, 4)
    assert texts(url) == [1, 2, 3, 4]


@pytest.mark.parametrize("at", [4, 100, 500, -100])
def test_a_checkpoint_of_which_a_part_was_not_written_is_set_aside(url: str, at: int) -> None:
    Store(url).table(EVENTS.name).create_checkpoint()
    [file] = log_of(url).glob("*.parquet")
    data = bytearray(file.read_bytes())
    data[at : at + 90] = bytes(90)
    cut(file, bytes(data))
    assert append(url, 4)
    assert texts(url) == [1, 2, 3, 4]
