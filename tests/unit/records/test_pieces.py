"""A journal in pieces: it rotates, keeps its chain, loses nothing to a crash, and is read in linear time."""

import io
import itertools
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.records import durable, journal, journal_files
from gateway.records.chain import Broken, Head, line
from gateway.records.journal import Journal, Sizes, head_file, read_verified
from gateway.records.reading import SHORTENED
from tests.support.waiting import WAIT_S

SMALL = Sizes(piece=2000, kept=1_000_000)
TIGHT = Sizes(piece=2000, kept=5000)


class Killed(BaseException):
    """The process ends here: nothing is caught, nothing is put right."""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "journal.jsonl"


def fill(path: Path, count: int = 40, sizes: Sizes = SMALL) -> None:
    """Each entry by itself, so that it is known where pieces end."""
    journal = Journal(path, "boot", sizes=sizes)
    for number in range(count):
        journal.append("tester", "note", number=number).result(WAIT_S)
    journal.close()


def closed(path: Path) -> list[Path]:
    return [piece.path for piece in journal_files.closed_pieces(path)]


def numbers(path: Path) -> list[int]:
    return [entry["n"] for entry in read_verified(path)]


def test_a_large_file_is_closed_and_the_chain_goes_on_in_the_next(path: Path) -> None:
    fill(path)
    assert len(closed(path)) > 3
    assert all(piece.stat().st_size < SMALL.piece + 1000 for piece in (*closed(path), path))
    assert numbers(path) == list(range(1, 41))
    entries = read_verified(path)
    assert all(after["previous"] == before["hash"] for before, after in itertools.pairwise(entries))
    for piece in closed(path):
        assert f'"n":{int(piece.suffix[1:])},' in piece.read_text().splitlines()[-1]


def test_a_journal_of_one_file_goes_on_in_pieces(path: Path) -> None:
    fill(path, 20, Sizes())
    assert closed(path) == []
    fill(path, 20)
    assert closed(path)[0].name == "journal.jsonl.000000000020"
    assert numbers(path) == list(range(1, 41))


def test_one_altered_byte_and_a_missing_piece_are_found(path: Path) -> None:
    fill(path)
    middle = closed(path)[1]
    whole = middle.read_bytes()
    middle.write_bytes(whole.replace(b"tester", b"tasted", 1))
    with pytest.raises(Broken, match="was altered"):
        read_verified(path)
    middle.unlink()
    with pytest.raises(Broken, match="lines were removed"):
        read_verified(path)
    middle.write_bytes(whole)
    closed(path)[0].unlink()
    with pytest.raises(Broken, match="are missing, and the journal does not say that it removed them"):
        read_verified(path)


def test_the_oldest_are_removed_beyond_what_is_kept_and_the_journal_says_so(path: Path) -> None:
    fill(path, 100, TIGHT)
    assert sum(piece.stat().st_size for piece in closed(path)) <= TIGHT.kept
    entries = read_verified(path)
    said = [entry for entry in entries if entry["what"] == SHORTENED][-1]
    assert said["up_to"] == entries[0]["n"] - 1 > 1
    assert said["up_to_hash"] == entries[0]["previous"]
    assert sum(entry["n"] == entries[-1]["n"] for entry in entries) == 1
    assert [entry["n"] for entry in entries] == list(range(entries[0]["n"], entries[-1]["n"] + 1))


def test_the_newest_closed_piece_is_kept_however_large_it_is(path: Path) -> None:
    fill(path, 100, Sizes())
    fill(path, 1, TIGHT)
    assert numbers(path) == list(range(1, 102))


def test_what_somebody_else_removed_is_not_taken_for_removed_by_the_journal(path: Path) -> None:
    fill(path, 100, TIGHT)
    closed(path)[0].unlink()
    with pytest.raises(Broken, match="does not say that it removed them"):
        read_verified(path)


def test_what_is_left_follows_the_line_that_the_journal_says_it_removed(path: Path) -> None:
    fill(path, 100, TIGHT)
    entries = read_verified(path)
    head, forged = Head(entries[0]["n"] - 1, "f" * 64), b""
    for entry in entries:
        fields = {key: value for key, value in entry.items() if key not in ("n", "previous", "hash")}
        data, head = line(head, fields)
        forged += data + b"\n"
    anew = path.with_name("forged.jsonl")
    anew.write_bytes(forged)
    with pytest.raises(Broken, match="does not follow the line that was removed before it"):
        read_verified(anew)


# A crash at any point of the rotation


def after(function: Callable[..., Any], when: Callable[..., bool]) -> Callable[..., Any]:
    """The same; but the process ends right behind it."""

    def killing(*arguments: Any, **named: Any) -> Any:
        result = function(*arguments, **named)
        if when(*arguments):
            raise Killed
        return result

    return killing


def before(function: Callable[..., Any], when: Callable[..., bool]) -> Callable[..., Any]:
    def killing(*arguments: Any, **named: Any) -> Any:
        if when(*arguments):
            raise Killed
        return function(*arguments, **named)

    return killing


def rotates(source: Path, _target: Path) -> bool:
    return source.name == "journal.jsonl"


def always(*_arguments: object) -> bool:
    return True


def has_no_newest(folder: Path) -> bool:
    return not (folder / "journal.jsonl").exists()


def has_an_empty_one(rotating: Journal) -> bool:
    return rotating.path.stat().st_size == 0


def is_piece(piece: Path) -> bool:
    return piece.name != "journal.jsonl.head.draft"


CRASHES = [
    pytest.param((Path, "replace", before, rotates), id="before-the-rename"),
    pytest.param((Path, "replace", after, rotates), id="after-the-rename"),
    pytest.param((durable, "sync_folder", after, has_no_newest), id="after-the-name-is-durable"),
    pytest.param((Journal, "_take_up", after, has_an_empty_one), id="after-the-new-file"),
    pytest.param((journal, "_append", before, always), id="before-its-first-line"),
    pytest.param((journal, "_append", after, always), id="after-its-first-line"),
    pytest.param((durable, "write", before, always), id="before-the-head"),
    pytest.param((durable, "write", after, always), id="after-the-head"),
    pytest.param((Path, "unlink", before, is_piece), id="before-the-oldest-is-removed"),
    pytest.param((Path, "unlink", after, is_piece), id="after-the-oldest-is-removed"),
]


class Dying(Journal):
    """Its thread is the process: what kills one ends the other, and nothing is tidied up."""

    died = False

    def _run(self) -> None:
        try:
            super()._run()
        except Killed:
            self.died = True


@pytest.mark.parametrize("crash", CRASHES)
@pytest.mark.parametrize("sizes", [SMALL, TIGHT], ids=["all-kept", "shortened"])
def test_a_crash_in_a_rotation_loses_nothing_and_leaves_a_chain(
    path: Path, crash: tuple[Any, ...], sizes: Sizes, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(path, 30, sizes)
    while path.stat().st_size < sizes.piece:  # the next entry rotates
        fill(path, 1, sizes)
    known = numbers(path)
    shortened = sum(entry["what"] == SHORTENED for entry in read_verified(path))
    where, name, kill, when = crash
    with monkeypatch.context() as killing:
        killing.setattr(where, name, kill(getattr(where, name), when))
        dying = Dying(path, "boot", sizes=sizes)
        dying.append("tester", "lost with the process")
        dying.close()
    assert dying.died == (name != "unlink" or sizes is TIGHT)
    entries = read_verified(path)
    assert set(known) - set(range(1, entries[0]["n"])) <= {entry["n"] for entry in entries}
    fill(path, 30, sizes)
    entries = read_verified(path)
    assert entries[-1]["n"] == entries[0]["n"] + len(entries) - 1
    assert not any(entry["what"] == "journal damaged" for entry in entries)
    assert sum(entry["what"] == SHORTENED for entry in entries) >= (shortened > 0)


def test_a_line_that_a_crash_left_half_written_in_a_new_piece_is_cut_off(path: Path) -> None:
    fill(path, 30)
    path.replace(path.with_name(f"journal.jsonl.{30:012}"))
    path.write_bytes(b'{"n":31,"who":"tes')
    fill(path, 1)
    entries = read_verified(path)
    assert [entry["n"] for entry in entries] == list(range(1, 33))
    assert entries[30]["what"] == "journal damaged"


def test_pieces_are_set_aside_with_a_journal_whose_end_does_not_hold(path: Path) -> None:
    fill(path, 30)
    count = len(closed(path))
    damaged = path.read_bytes()[:-3] + b"?" + path.read_bytes()[-2:]
    path.write_bytes(damaged)
    fill(path, 1)
    assert [entry["what"] for entry in read_verified(path)] == ["journal damaged", "note"]
    assert len(list(path.parent.glob("journal.jsonl.broken-*.0*"))) == count
    assert closed(path) == []


def test_a_piece_that_cannot_be_renamed_is_written_on(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fill(path, 4)
    replace = Path.replace

    def refuses(source: Path, target: Path) -> Path:
        if source == path:
            raise PermissionError(1, "Operation not permitted")
        return replace(source, target)

    monkeypatch.setattr(Path, "replace", refuses)
    fill(path, 30)
    assert closed(path) == []
    assert numbers(path) == list(range(1, 35))


# Reading


class Counting(io.BytesIO):
    """Counts what is read, and what is copied by putting pieces together again and again."""

    bytes_read = copied = 0

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        self.bytes_read += len(data)
        return Copied(data, self)


class Copied(bytes):
    """Bytes that count when they are added to others."""

    file: Counting

    def __new__(cls, data: bytes, file: Counting) -> "Copied":
        made = super().__new__(cls, data)
        made.file = file
        return made

    def split(self, *arguments: Any) -> "list[Copied]":  # type: ignore[override]
        return [Copied(one, self.file) for one in super().split(*arguments)]

    def __add__(self, other: Any) -> "Copied":
        self.file.copied += len(self) + len(other)
        return Copied(bytes(self) + bytes(other), self.file)


def test_lines_are_read_backwards_each_byte_once() -> None:
    lines = [b"%d " % number + b"x" * 997 for number in range(5000)]
    file = Counting(b"\n".join(lines) + b"\nhalf a line")
    assert list(journal_files.lines_backwards(file)) == lines[::-1]
    assert file.bytes_read <= 5_100_000
    assert file.copied == 0


def test_a_long_line_is_put_together_once() -> None:
    line = b"x" * 8_000_000
    file = Counting(line + b"\n")
    assert list(journal_files.lines_backwards(file)) == [line]
    assert file.copied == 0


def test_a_line_longer_than_any_that_was_written_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal_files, "LINE_BYTES", 1_000_000)
    file = Counting(b"x" * 8_000_000 + b"\n")
    with pytest.raises(Broken, match="more than 1000000 bytes"):
        list(journal_files.lines_backwards(file))
    assert file.bytes_read <= 1_500_000


@pytest.mark.parametrize("size", [0, 1, 5, 65535, 65536, 65537, 300_000])
def test_lines_of_any_length_are_found(size: int) -> None:
    lines = [b"a" * size, b"", b"b" * size, b"c"]
    file = io.BytesIO(b"\n".join(lines) + b"\n")
    assert list(journal_files.lines_backwards(file)) == lines[::-1]


def test_only_what_is_taken_is_read() -> None:
    file = Counting(b"".join(b"%d\n" % number for number in range(300_000)))
    assert list(itertools.islice(journal_files.lines_backwards(file), 3)) == [b"299999", b"299998", b"299997"]
    assert file.bytes_read <= 200_000


def test_a_tail_goes_over_pieces(path: Path) -> None:
    fill(path)
    journal = Journal(path, "boot", sizes=SMALL)
    for count in (1, 7, 23, 40, 1000):
        entries, cut = journal.tail(count).result(WAIT_S)
        assert [entry["n"] for entry in entries] == list(range(max(1, 41 - count), 41))
        assert cut is None
    journal.close()


def test_a_tail_is_cut_at_its_bytes_and_says_so(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(journal_files, "TAIL_BYTES", 3000)
    fill(path)
    journal = Journal(path, "boot", sizes=SMALL)
    entries, cut = journal.tail(30).result(WAIT_S)
    journal.close()
    assert [entry["n"] for entry in entries] == list(range(41 - len(entries), 41))
    assert 3 < len(entries) < 30
    assert cut == f"these {len(entries)} of 30 fill the 3000 bytes of an answer"


def test_whoever_reads_does_not_hold_the_writer(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is appended while somebody reads is durable before that has ended."""
    journal = Journal(path, "boot")
    journal.append("tester", "first").result(WAIT_S)
    tail = journal_files.tail

    def slowly(*arguments: Any) -> journal_files.Tail:
        journal.append("tester", "while somebody reads").result(WAIT_S)
        return tail(*arguments)

    monkeypatch.setattr(journal_files, "tail", slowly)
    entries, _ = journal.tail(10).result(WAIT_S)
    assert [entry["what"] for entry in entries] == ["first"]
    journal.close()


def test_a_piece_that_is_closed_while_it_is_read_is_not_given_twice(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(path)
    listed = journal_files.closed_pieces

    def rotating(journal: Path) -> list[journal_files.ClosedJournalFile]:
        if journal.exists():
            journal.replace(journal_files.closed_piece(journal, 40).path)
        return listed(journal)

    monkeypatch.setattr(journal_files, "closed_pieces", rotating)
    assert [entry["n"] for entry in journal_files.tail(path, 100, 40).entries] == list(range(1, 41))


def test_verifying_opens_anew_where_a_piece_was_closed_meanwhile(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(path)
    opened = Path.open

    def rotating(self: Path, *arguments: Any, **named: Any) -> Any:
        if self == path and not journal_files.closed_piece(path, 40).path.exists():
            path.replace(journal_files.closed_piece(path, 40).path)
        return opened(self, *arguments, **named)

    monkeypatch.setattr(Path, "open", rotating)
    assert numbers(path) == list(range(1, 41))


# Room


@pytest.fixture
def roomy(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    def has(free: int) -> None:
        status = os.statvfs_result((1, 1, 0, 0, free, 0, 0, 0, 0, 255))
        monkeypatch.setattr("gateway.records.journal.os.statvfs", lambda _path: status)

    return has


def test_the_first_entry_says_how_much_room_is_left(path: Path, roomy: Callable[[int], None]) -> None:
    roomy(10**9)
    fill(path, 2, Sizes())
    first, second = read_verified(path)
    assert first["room"] == {"free_bytes": 10**9, "may_grow_bytes": (256 + 16) * 1024 * 1024}
    assert "room" not in second


def test_little_room_is_a_warning(
    path: Path, roomy: Callable[[int], None], caplog: pytest.LogCaptureFixture
) -> None:
    roomy(5_000_000)
    fill(path, 1, Sizes())
    assert "5 MB are free" in caplog.text
    caplog.clear()
    roomy(10**9)
    fill(path, 1, Sizes())
    assert caplog.text == ""
    assert head_file(path).exists()
