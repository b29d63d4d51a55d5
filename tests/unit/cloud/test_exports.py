"""What was exported on this desk is found where a wearer is forgotten: removed, or named."""

import errno
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.main import main
from server_gui.core.cloud import actions, exports, mend
from server_gui.core.cloud.jobs import Job
from server_gui.core.cloud.recordings import Recordings
from server_gui.core.cloud.selection import Choice
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.spool_files import identity
from server_gui.core.recording.upload import send
from server_gui.core.settings.server_file import exports_folder, load
from tests.unit.cloud.test_forget import HERS, HERS_TOO, HIS, Server, recorded, run, server

__all__ = ["server"]  # a fixture
FORGET = ("forget", "--wearer", "P01", "--yes")


def export(server: Server, session: str, file: Path, status: int = 0) -> Path:
    assert main(["sessions", "export", session, "--out", str(file), "--config", str(server.config)]) == status
    server.told()
    return file


def _edited(file: Path) -> None:
    file.write_bytes(file.read_bytes() + b"more")


def _linked(file: Path) -> None:
    file.rename(file.with_suffix(".other"))
    file.symlink_to(file.with_suffix(".other"))


def _named_twice(file: Path) -> None:
    file.with_suffix(".other").hardlink_to(file)


def _a_folder(file: Path) -> None:
    file.unlink()
    file.mkdir()


CHANGES: dict[Callable[[Path], None], str] = {
    _edited: "has changed since",
    _linked: "has changed since",
    _a_folder: "has changed since",
    _named_twice: "has another name too",
}


def test_what_came_to_its_place_since_it_was_found_is_not_removed(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between the question and the end there may be hours; what was exported in them is found too."""
    file, late = export(server, HERS, tmp_path / "some.csv"), tmp_path / "late.csv"
    accept = mend.accept

    def meanwhile(*arguments: Any) -> None:
        file.write_bytes(b"of somebody else")
        with exports.noted(late, ("exo", HERS)):
            late.write_bytes(b"hers")
        accept(*arguments)

    monkeypatch.setattr(mend, "accept", meanwhile)
    assert f"{file} was exported with rows of theirs, and has changed" in server.run(*FORGET, status=1)
    assert file.read_bytes() == b"of somebody else"
    assert not late.exists()


def test_what_stays_is_named_with_why_and_all_else_is_removed(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also in a folder whose name a shell would take for a pattern, and what the window has exported.

    What was exported of others stays.
    """
    hers = [export(server, HERS, tmp_path / f"hers.{kind}") for kind in ("csv", "parquet", "mcap")]
    his = export(server, HIS, tmp_path / "his.csv")
    told = server.run("forget", "--wearer", "P01", "--dry-run")
    assert all(f"exported: {file} (as it was made)" in told for file in hers)
    assert str(his) not in told
    assert all(file.exists() for file in hers)
    folder, copied, windows = tmp_path / "wal[k] *?", tmp_path / "copied", tmp_path / "window's.csv"
    folder.mkdir()
    said = {
        export(server, HERS, folder / f"[{change.__name__}]*.csv"): why for change, why in CHANGES.items()
    }
    for file, change in zip(said, CHANGES, strict=True):
        change(file)
    for name, method in (("stays", "unlink"), ("unseen", "lstat")):
        file = export(server, HERS, tmp_path / f"{name}.csv")
        monkeypatch.setattr(Path, method, _refusing(getattr(Path, method), file))
        said[file] = "cannot be looked at or removed (Permission denied)"
    (session,) = [each for each in Recordings(server.url, server.spool).sessions() if each.session == HERS]
    actions.export(load(server.config), session, Choice(), "csv", windows)(Job("export"))
    actions.download(server.url, copied, [session])(Job("download"))
    (exports_folder() / "0.json").mkdir()

    told = server.run(*FORGET, status=1)
    for file, why in said.items():
        assert f"{file} was exported with rows of theirs, and {why}" in told
        assert os.path.lexists(file)
    assert f"{copied.as_uri()} is a copy that has rows of theirs" in told
    assert f"{exports_folder() / '0.json'} is an entry of the list of exports that cannot be read" in told
    assert "gone:" not in told
    assert not windows.exists()
    assert [file.exists() for file in (*hers, his)] == [False, False, False, True]
    known = "".join(each.read_text() for each in exports_folder().iterdir() if each.is_file())
    assert str(his) in known
    assert not any(str(file) in known for file in (*hers, windows))
    assert exports_folder().stat().st_mode & 0o077 == 0
    assert server.rows() == {HIS}


def _refusing(was: Callable[..., Any], refused: Path) -> Callable[..., Any]:
    """As where a folder is somebody else's."""

    def refusing(file: Path, **options: Any) -> Any:
        if file == refused:
            raise PermissionError(errno.EACCES, "Permission denied", str(file))
        return was(file, **options)

    return refusing


def test_a_file_that_was_moved_is_said_to_be_out_of_reach(server: Server, tmp_path: Path) -> None:
    file = export(server, HERS, tmp_path / "hers.csv")
    file.rename(tmp_path / "elsewhere.csv")
    said = server.run(*FORGET, status=3)
    assert f"not looked into: what was exported to {file}" in said
    assert "gone:" not in said
    assert server.rows() == {HIS}


def test_an_export_that_ends_early_is_known_with_what_was_there(
    server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An older export of hers is still there, where that of his was cut off."""
    file = export(server, HERS, tmp_path / "some.csv")
    with monkeypatch.context() as cut:
        cut.setattr("server_gui.core.cloud.tabular._write", lambda *_: 1 / 0)
        export(server, HIS, file, status=1)
    assert f"{file} was exported with rows of theirs" in server.run(*FORGET, status=1)


def test_a_place_that_has_something_else_now_is_not_hers(server: Server, tmp_path: Path) -> None:
    file = export(server, HERS, tmp_path / "some.csv")
    export(server, HIS, file)
    server.run(*FORGET)
    assert file.exists()


def test_a_copy_of_the_store_is_named_until_it_has_forgotten_too(server: Server, tmp_path: Path) -> None:
    copied = tmp_path / "a copy"
    server.run("download", "--out", str(copied))
    said = server.run(*FORGET, status=1)
    assert f"{copied.as_uri()} is a copy that has rows of theirs" in said
    (found,) = exports.found([("exo", HERS)], server.url)
    assert found.state is exports.ExportState.HAS_ROWS
    server.config.write_text(f'[recorder]\nspool = "{tmp_path / "none"}"\n')
    server.run("forget", "--url", copied.as_uri(), "--wearer", "P01", "--yes")
    assert exports.found([("exo", HERS)], server.url) == []


def test_an_entry_that_cannot_be_read_is_named(server: Server, tmp_path: Path) -> None:
    export(server, HIS, tmp_path / "his.csv")
    (entry,) = exports_folder().iterdir()
    entry.write_bytes(b"{")
    assert f"{entry} is an entry of the list of exports that cannot be read" in server.run(*FORGET, status=1)


def test_what_cannot_be_noted_is_not_exported(server: Server, tmp_path: Path) -> None:
    exports_folder().parent.mkdir(parents=True, exist_ok=True)
    exports_folder().write_text("no folder")
    file = export(server, HERS, tmp_path / "hers.csv", status=1)
    assert not file.exists()


def test_other_computers_are_named_and_their_second_copies_forgotten_there(
    server: Server, tmp_path: Path
) -> None:
    """Whose store has nothing of her any more: what is left of her is in that computer's spool alone.

    One whose second copies are gone is told why its rows are missing.
    """
    there, name = tmp_path / "there", "20261121T193000Z-eeeeee"
    without = tmp_path / "without"
    for spool, session in ((there, name), (without, f"{name[:-1]}f")):
        with Spool(spool, reserve_bytes=0) as opened:
            opened.append([run(session)], recorded(session, "P01"))
            opened.freeze()
            for number in opened.waiting():
                send(opened, number, server.store)
                if spool is without:
                    opened.drop(number)
    said = server.run(*FORGET)
    assert "other computers that write to this store (" in said
    assert all(identity(spool) in said for spool in (there, without))
    assert any(name.encode() in file.read_bytes() for file in there.glob("*.db"))
    server.config.write_text(f'[recorder]\nspool = "{there}"\n[store]\nurl = "{server.url}"\n')
    config = tmp_path / "without.toml"
    config.write_text(f'[recorder]\nspool = "{without}"\n[store]\nurl = "{server.url}"\n')
    assert main(["cloud", "mend", "--config", str(config)]) == 1
    said = server.told()
    assert "A wearer was forgotten here on 20" in said
    assert "--accept-loss counts what is there as what was sent" in said
    server.run(*FORGET)
    assert not any(name.encode() in file.read_bytes() for file in there.glob("*.db"))
    server.run("verify")
    server.run("mend")
    assert server.rows() == {HIS}


def test_machines_are_told_of_both(server: Server, tmp_path: Path) -> None:
    file = export(server, HERS_TOO, tmp_path / "hers.csv")
    plan = json.loads(server.run("forget", "--wearer", "P01", "--dry-run", "--json"))["plan"]
    assert plan["exported"] == [{"place": str(file), "state": "as it was made", "why": ""}]
    assert plan["others"] == []
