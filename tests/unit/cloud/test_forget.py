"""A wearer is forgotten: no file of store and spool has a row of theirs, in any version; others keep all."""

import io
import json
import sys
from pathlib import Path
from typing import Any

import pyarrow.dataset
import pyarrow.parquet as pq
import pytest

from gateway.main import main
from ml.store import Store, StoreUnreachable, upkeep
from ml.store.labels import WEARER, Label
from ml.store.sessions import rows_of, sessions
from ml.store.tables import EVENTS, LABELS, PREDICTIONS, SESSIONS, TELEMETRY
from server_gui.core.cloud.forget import digest
from server_gui.core.recording import records
from server_gui.core.recording.records import Facts, Worn
from server_gui.core.recording.rows import Record
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from tests.unit.cloud.filled import Filled
from tests.unit.training import walkers
from tests.unit.training.walkers import BEGAN_UTC, S, day, put

HERS = "20261121T153000Z-aaaaaa"
HERS_TOO = "20261121T173000Z-bbbbbb"  # by the session's own field, spelled another way
WAITS = "20261121T183000Z-cccccc"  # in the spool still
HIS = "20261121T163000Z-dddddd"


class Server:
    """Its file, spool and store, with four sessions of two wearers; `run` is the command line."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.spool, self.url = folder / "spool", (folder / "store").as_uri()
        self.config = folder / "server.toml"
        self.config.write_text(f'[recorder]\nspool = "{self.spool}"\n[store]\nurl = "{self.url}"\n')
        self._capsys = capsys
        self.store = Store.existing(self.url)

    def run(self, *words: str, status: int = 0) -> str:
        assert main(["cloud", *words, "--config", str(self.config)]) == status
        return self.told()

    def told(self) -> str:
        said = self._capsys.readouterr()
        return said.out + said.err

    def rows(self, table: str = TELEMETRY.location("exo", 1)) -> set[str]:
        """Of which sessions there are any."""
        found = self.store.dataset(table).to_table(columns=["session"])["session"].to_pylist()
        return {name for name in found if name}

    def bytes_of(self, text: str) -> list[str]:
        """In which data files a text is found, or that are of a session of that name."""
        folder = Path(self.url.removeprefix("file://"))
        files = [file for file in folder.rglob("*.parquet") if "_delta_log" not in file.parts]
        return [
            str(file)
            for file in files
            if f"session={text}" in str(file)
            or text in json.dumps(pq.read_table(file).to_pylist(), default=str)
        ]


def run(session: str) -> Any:
    return walkers._run(day(session, 3, each_s=1), BEGAN_UTC + 7200 * S)


def recorded(session: str, wearer: str) -> list[Record]:
    began = BEGAN_UTC + 7200 * S
    facts = Facts(worn=Worn(wearer, "study 12, signed"))
    said = {
        "robot": "exo",
        "session": session,
        "utc": began,
        "stamp_ns": 1,
        "task": "activity",
        "label": "walk",
    }
    event = {"robot": "exo", "session": session, "utc": began, "kind": "marker", "text": "stumbled"}
    return [
        records.Session("exo", session, began, facts, began + 3 * S).record(),
        Record(PREDICTIONS.name, said),
        Record(EVENTS.name, event),
    ]


def fill(folder: Path) -> None:
    """Record the four sessions; one of them waits in the spool."""
    url, spool = (folder / "store").as_uri(), folder / "spool"
    put(url, spool, [day(HERS, 1, each_s=2, wearer="P01"), day(HIS, 2, each_s=2, wearer="P02")])
    with Spool(spool, reserve_bytes=0) as opened:
        opened.append([run(HERS_TOO)], recorded(HERS_TOO, "p01 "))
        opened.freeze()
        for number in opened.waiting():
            send(opened, number, Store.existing(url))
        opened.append([run(WAITS)], [*recorded(WAITS, "P-1")])
        opened.freeze()


@pytest.fixture
def server(worn: Filled, capsys: pytest.CaptureFixture[str]) -> Server:
    return Server(worn.anew(), capsys)


def test_consent_and_wearer_are_told_with_a_session(server: Server) -> None:
    (one,) = [session for session in sessions(server.store) if session.session == HERS_TOO]
    assert (one.wearer, one.consent) == ("p01 ", "study 12, signed")


def is_told_by_a_hash_alone(server: Server) -> None:
    (event,) = server.store.dataset(EVENTS.name).to_table().to_pylist()
    assert (event["kind"], json.loads(event["data"])["sessions"]) == ("forgotten", 3)
    assert json.loads(event["data"])["wearer_sha256"] == digest("p-01")
    assert "P01" not in json.dumps(event, default=str)


def test_nothing_of_a_wearer_is_left_and_others_keep_all(server: Server) -> None:
    """Nor of what an interrupted writer has left: no log names such a file, so no version has it."""
    folder = Path(server.url.removeprefix("file://"))
    (some,) = [file for file in folder.rglob("*.parquet") if f"session={HERS}" in str(file)]
    (some.parent / "left.parquet").write_bytes(some.read_bytes())
    before = rows_of(server.store, next(s for s in sessions(server.store) if s.session == HIS), LABELS)
    upkeep.compact(server.store)  # their rows are in files of older versions, too
    said = server.run("forget", "--wearer", "p 1", "--yes")
    assert "gone: no file of this store, of this spool or of this desk's exports has a row of theirs" in said
    assert server.rows() == {HIS}
    assert server.rows(LABELS.name) == server.rows(SESSIONS.name) == {HIS}
    for name in (HERS, HERS_TOO, WAITS, f"{WEARER}P01"):
        assert server.bytes_of(name) == []
        assert name.encode() not in b"".join(file.read_bytes() for file in server.spool.glob("*.db"))
    assert rows_of(server.store, next(iter(sessions(server.store))), LABELS) == before
    is_told_by_a_hash_alone(server)
    server.run("verify")  # and what is gone is missed by nobody
    server.run("mend")
    assert server.rows() == {HIS}


def test_a_dry_run_and_a_no_remove_nothing(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    said = server.run("forget", "--wearer", "P01", "--dry-run")
    assert all(name in said for name in (HERS, HERS_TOO, WAITS))
    assert HIS not in said
    assert "1 batch of the spool may have more" in said
    answer = io.StringIO("n\n")
    monkeypatch.setattr(answer, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stdin", answer)
    assert "for good?" in server.run("forget", "--wearer", "P01", status=1)
    assert server.rows() == {HERS, HERS_TOO, HIS}


def test_nobody_is_nobody(server: Server) -> None:
    assert "nothing here says" in server.run("forget", "--wearer", "P03", "--yes", status=1)
    assert "is nobody's name" in server.run("forget", "--wearer", " - ", "--yes", status=1)


def test_versions_that_a_model_names_are_named_and_go_only_when_that_is_said(server: Server) -> None:
    location = TELEMETRY.location("exo", 1)
    upkeep.pin(server.store, location, server.store.table(location).version(), "activity-0000")
    refused = server.run("forget", "--wearer", "P01", "--yes", status=1)
    assert "nothing was removed" in refused
    assert "activity-0000" in refused
    assert server.rows() == {HERS, HERS_TOO, HIS}
    server.run("forget", "--wearer", "P01", "--yes", "--unpin")
    assert upkeep.pins(server.store) == []
    assert server.bytes_of(HERS) == []


def test_a_session_of_two_wearers_is_nobodys_to_remove(server: Server) -> None:
    label = Label("exo", HERS, BEGAN_UTC, BEGAN_UTC + S, f"{WEARER}P02", "ben")
    with Spool(server.spool, reserve_bytes=0) as opened:
        opened.append([], [records.label(label)])
        opened.freeze()
    assert "somebody else is said to have worn" in server.run("forget", "--wearer", "P01", "--yes", status=1)
    assert server.rows() == {HERS, HERS_TOO, HIS}


@pytest.mark.parametrize("where", ["ml.store.upkeep.vacuum", "server_gui.core.cloud.mend.accept"])
def test_what_was_cut_off_goes_on(server: Server, monkeypatch: pytest.MonkeyPatch, where: str) -> None:
    """Also where the tables do not say any more whose a session was."""

    def breaks(*_: object) -> None:
        raise StoreUnreachable("the network is gone")

    with monkeypatch.context() as cut:
        cut.setattr(where, breaks)
        assert "the network is gone" in server.run("forget", "--wearer", "P01", "--yes", status=2)
    server.run("forget", "--wearer", "P-01", "--yes")
    assert server.rows() == {HIS}
    assert server.bytes_of(HERS) == server.bytes_of(WAITS) == []
    server.run("verify")
    server.run("forget", "--wearer", "P01", "--yes", status=1)


def test_what_stays_beside_theirs_is_found_by_whose_it_is(server: Server) -> None:
    """A file that is written anew has texts as others have: else nothing is found by them any more."""
    for number, robot in enumerate(("left", "right", "exo")):
        began = BEGAN_UTC + 9000 * S + number
        with Spool(server.spool, reserve_bytes=0) as opened:
            opened.append(
                [], [records.Session(robot, f"{HIS[:-1]}{number}", began, Facts(), began + S).record()]
            )
    server.run("upload")
    upkeep.compact(server.store)
    server.run("forget", "--wearer", "P01", "--yes")
    column = pyarrow.dataset.field
    found = server.store.dataset(SESSIONS.name)
    for robot, count in (("left", 1), ("exo", 2), ("nobody", 0)):
        assert found.count_rows(filter=column("robot") == robot) == count
