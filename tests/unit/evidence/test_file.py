"""Evidence is found again: whole lines, the newest of each edit, whatever happened to the file."""

import stat
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from server_gui.core.evidence import file as evidence_file
from server_gui.core.evidence.comparison import compare
from server_gui.core.evidence.edits import EditState
from server_gui.core.evidence.file import EditEvidence, EvidenceFile, folder_beside, forget, read_all
from tests.unit.evidence.synthetic import cycles, spell
from tests.unit.evidence.test_edits import journal


def told(write: int = 1, *, is_final: bool = True) -> EditEvidence:
    (edit,) = journal((200 + write, "write", write), (201 + write, "write done", write)).all
    return EditEvidence(edit, compare(cycles(), spell(), ["left_knee"]), is_final, "20261121T1530")


def test_what_was_kept_is_read_again(tmp_path: Path) -> None:
    folder = folder_beside(tmp_path / "spool")
    EvidenceFile(folder, "exo-01").add(told())
    EvidenceFile(folder, "exo 2/x").add(told(2))
    assert read_all(folder) == [told(), told(2)]
    path = EvidenceFile(folder, "exo-01").path
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_the_newest_line_of_an_edit_counts(tmp_path: Path) -> None:
    file = EvidenceFile(tmp_path, "exo-01")
    file.add(told(is_final=False))
    file.add(told(2))
    file.add(told())
    assert [one.is_final for one in file.read().values()] == [True, True]
    assert [one.edit.write for one in file.read().values()] == [1, 2]


def test_nothing_is_no_error(tmp_path: Path) -> None:
    assert read_all(tmp_path / "none") == []
    assert EvidenceFile(tmp_path, "exo-01").read() == {}


@pytest.mark.parametrize("cut", [1, 40])
def test_a_line_that_a_crash_has_cut_costs_no_other(tmp_path: Path, cut: int) -> None:
    file = EvidenceFile(tmp_path, "exo-01")
    file.add(told())
    file.add(told(2))
    file.path.write_bytes(file.path.read_bytes()[:-cut])
    file.add(told(3))
    kept = [one.edit.write for one in file.read().values()]
    assert kept == ([1, 2, 3] if cut == 1 else [1, 3])


def test_another_format_is_left_alone(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = EvidenceFile(tmp_path, "exo-01")
    file.add(told())
    with file.path.open("ab") as lines:
        lines.write(msgspec.json.encode({"format": 2, "edit": "otherwise"}) + b"\n")
    assert [one.edit.state for one in file.read().values()] == [EditState.KEPT]
    assert "newer gwrms" in caplog.text


def test_what_is_known_of_somebody_who_is_forgotten_goes(tmp_path: Path) -> None:
    file = EvidenceFile(tmp_path, "exo-01")
    file.add(told())
    file.add(replace(told(2), session="20261122T0900"))
    with file.path.open("ab") as lines:
        lines.write(b'{"format": 2, "session": "20261121T1530", "edit": {"robot": "exo-01"}}\n')
        lines.write(b'{"format": 2, "session": "20261122T0900", "edit": {"robot": "exo-01"}}\n{"torn')
    assert forget(tmp_path, {("exo-01", "20261121T1530")}) == []
    assert [one.edit.write for one in file.read().values()] == [2]
    assert b"20261121T1530" not in file.path.read_bytes()
    assert b"torn" not in file.path.read_bytes()
    assert b'"format": 2' in file.path.read_bytes()
    assert stat.S_IMODE(file.path.stat().st_mode) == 0o600


@pytest.mark.parametrize("line", [b'{"format":1,"x":' + b"[" * 100_000 + b"]" * 100_000 + b"}", b"\xff\xfe"])
def test_a_line_that_is_nonsense_costs_no_other(tmp_path: Path, line: bytes) -> None:
    file = EvidenceFile(tmp_path, "exo-01")
    file.add(told())
    with file.path.open("ab") as lines:
        lines.write(line + b"\n")
    file.add(told(2))
    assert [one.edit.write for one in file.read().values()] == [1, 2]
    assert forget(tmp_path, {("exo-01", "another")}) == []


@pytest.mark.parametrize("first", ["add", "forget"])
def test_a_line_that_comes_while_somebody_is_forgotten_is_not_lost(
    tmp_path: Path, first: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each order: whoever comes second waits until the first is done, and finds what that has left."""
    file = EvidenceFile(tmp_path, "exo-01")
    file.add(told())
    begun, go_on = threading.Event(), threading.Event()

    def held(real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            found = real(*arguments)
            begun.set()
            assert go_on.wait(10.0)
            return found

        return call

    acts: dict[str, Callable[[], object]] = {
        "add": lambda: file.add(replace(told(2), session="20261122T0900")),
        "forget": lambda: forget(tmp_path, {("exo-01", "20261121T1530")}),
    }
    inside = {"add": "_ends_whole", "forget": "draft"}[first]  # called when it has the folder
    monkeypatch.setattr(evidence_file, inside, held(getattr(evidence_file, inside)))
    second = next(act for name, act in acts.items() if name != first)
    with ThreadPoolExecutor(2) as pool:
        earlier = pool.submit(acts[first])
        assert begun.wait(10.0)
        later = pool.submit(second)
        with pytest.raises(TimeoutError):
            later.result(0.05)  # without the lock it is over by now
        go_on.set()
        earlier.result(10.0)
        later.result(10.0)
    assert [one.edit.write for one in file.read().values()] == [2]
