"""`gwrms sessions`, `query` and `cloud` as somebody types them."""

import csv
import json
import os
import shutil
import socketserver
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from gateway.main import main
from ml.store import Store
from ml.store.upkeep import pin
from server_gui.core.fleet.control_socket import NAME
from server_gui.core.recording.spool import Spool
from tests.unit.cloud.recordings import Recorded, record

ROWS = 100


class Desk:
    """A server's file, its store in a folder and its spool; `run` is the command line."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.url = (folder / "store").as_uri()
        self.spool = folder / "spool"
        self.config = folder / "server.toml"
        self.config.write_text(f'[store]\nurl = "{self.url}"\n[recorder]\nspool = "{self.spool}"\n')
        self._capsys = capsys

    def run(self, *words: str, status: int = 0) -> str:
        """What it prints, or where `status` is another one, what it complains of."""
        assert main([*words, "--config", str(self.config)]) == status
        said = self._capsys.readouterr()
        return said.err if status else said.out

    def ask(self, *words: str, status: int = 0) -> Any:
        assert main([*words, "--config", str(self.config), "--json"]) == status
        return json.loads(self._capsys.readouterr().out)

    def record(self, robot: str = "exo-01", *, sent: bool = True) -> Recorded:
        return record(self.url, self.spool, robot, sent=sent)


@pytest.fixture
def desk(store_libraries: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Desk:
    return Desk(tmp_path, capsys)


def test_sessions_are_listed_also_those_that_wait_for_upload(desk: Desk) -> None:
    first, second = desk.record(), desk.record("exo-02", sent=False)
    listed = desk.ask("sessions", "ls")
    assert [(each["session"], each["rows"], each["uploaded"]) for each in listed] == [
        (first.session, ROWS, True),
        (second.session, 0, False),
    ]
    assert "not uploaded" in desk.run("sessions", "ls", "--robot", "*2")
    assert first.session not in desk.run("sessions", "ls", "--robot", "*2")
    assert desk.ask("sessions", "ls", "--to", "2020-01-01") == []
    assert len(desk.ask("sessions", "ls", "--from", "2020-01-01T00:00")) == 2


@pytest.mark.parametrize("damage", ["a batch", "the folder"])
def test_sessions_of_the_store_are_listed_where_the_spool_cannot_be_read(
    desk: Desk, damage: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stored, waiting = desk.record(), desk.record("exo-02", sent=False)
    if damage == "a batch":
        file = desk.spool / "00000002.db"
        assert file.exists()
        file.write_bytes(b"x" * 20_000)
        told = "00000002.db is damaged: file is not a database; gwrms cloud upload sets it aside; sessions"
    else:
        access = os.access
        monkeypatch.setattr(os, "access", lambda path, mode: not mode & os.R_OK and access(path, mode))
        told = f"the spool {desk.spool} cannot be read: it belongs to somebody else; sessions"
    assert main(["sessions", "ls", "--config", str(desk.config)]) == 1
    said = capsys.readouterr()
    assert f"{told} that it alone has are not listed" in said.err
    assert stored.session in said.out
    assert waiting.session not in said.out


def test_telemetry_that_has_gone_is_told_where_sessions_are_listed(
    desk: Desk, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recorded = record(desk.url, desk.spool)
    assert recorded.store.folder is not None
    shutil.rmtree(recorded.store.folder / "telemetry")
    assert main(["sessions", "ls", "--config", str(desk.config)]) == 1
    said = capsys.readouterr()
    assert recorded.session in said.out
    assert (
        f"telemetry/000 has gone from {desk.url}, though batches of the spool {desk.spool} went" in said.err
    )
    assert main(["sessions", "ls", "--url", desk.url, "--config", str(desk.config)]) == 0
    assert "no session has telemetry: if some was uploaded, it has gone" in capsys.readouterr().err


def test_sessions_are_listed_before_anything_was_uploaded(desk: Desk) -> None:
    assert "no store at" in desk.run("sessions", "ls", status=1)
    recorded = desk.record(sent=False)
    Path(desk.url.removeprefix("file://"), "store.json").unlink()
    assert [each["session"] for each in desk.ask("sessions", "ls")] == [recorded.session]


def test_what_this_computer_has_is_told_where_the_store_is_away(
    desk: Desk, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded = desk.record()
    for name, value in {
        "ENDPOINT_URL": "http://127.0.0.1:9",
        "ACCESS_KEY_ID": "k",
        "SECRET_ACCESS_KEY": "s",
    }.items():
        monkeypatch.setenv(f"AWS_{name}", value)
    desk.config.write_text(desk.config.read_text().replace(desk.url, "s3://nowhere/lab"))
    assert main(["sessions", "ls", "--config", str(desk.config)]) == 1
    told = capsys.readouterr()
    assert "Connection refused" in told.err
    assert "store away" in told.out
    assert f"found here     {ROWS} of these rows" in desk.run("sessions", "show", "2")
    desk.run("sessions", "export", recorded.session, "--out", str(tmp_path / "walk.csv"))
    assert "nowhere" in desk.run("sessions", "show", "1999", status=1)


def test_what_waits_for_upload_is_labelled_by_seconds(desk: Desk) -> None:
    desk.record(sent=False)
    assert desk.run("label", "2", "right_heel_strike", "--from", "0", "--author", "bob")
    shown = desk.ask("sessions", "show", "2")
    [label] = [each for each in shown["labels"] if each["author"] == "bob"]
    assert label["utc"][:-4] == shown["first"][:-4]  # which the store knows to the millisecond


def test_a_store_by_its_url_is_looked_into_without_this_computers_spool(
    desk: Desk, capsys: pytest.CaptureFixture[str]
) -> None:
    desk.record("exo-01")
    desk.record("exo-02", sent=False)
    assert len(desk.ask("sessions", "ls")) == 2
    assert [each["robot"] for each in desk.ask("sessions", "ls", "--url", desk.url)] == ["exo-01"]


def test_a_session_is_shown(desk: Desk) -> None:
    recorded = desk.record()
    text = desk.run("sessions", "show", recorded.session)
    for word in ("anna", "gain=2.0, step=1\n", "left_knee.velocity  rad/s", "marker", "here", "walk"):
        assert word in text
    shown = desk.ask("sessions", "show", recorded.session[:-1])
    assert {each["name"]: each["unit"] for each in shown["channels"]}["left_knee.velocity"] == "rad/s"
    assert [each["kind"] for each in shown["events"]] == ["gap", "marker"]
    assert [each["label"] for each in shown["labels"]] == ["walk"]
    assert "no session 'x'" in desk.run("sessions", "show", "x", status=1)


@pytest.mark.parametrize("kind", ["csv", "parquet", "mcap"])
def test_a_session_is_exported_as_what_the_files_name_says(desk: Desk, tmp_path: Path, kind: str) -> None:
    recorded = desk.record()
    file = tmp_path / f"walk.{kind}"
    found = desk.ask(
        "sessions", "export", recorded.session, "--out", str(file), "--from", "0", "--to", "3600"
    )
    assert found["format"] == kind
    assert found["count"] >= ROWS
    assert file.stat().st_size > 1000


def test_an_export_needs_a_format_and_a_folder(desk: Desk, tmp_path: Path) -> None:
    recorded = desk.record()
    file = tmp_path / "nowhere" / "walk.csv"
    assert "there is no folder" in desk.run(
        "sessions", "export", recorded.session, "--out", str(file), status=1
    )
    with pytest.raises(SystemExit) as left:
        desk.run("sessions", "export", "x", "--out", str(tmp_path / "walk.bag"))
    assert left.value.code == 2


def test_a_query_is_a_table_an_array_or_csv(desk: Desk) -> None:
    desk.record()
    sql = "SELECT robot, count(*) AS n, NULL AS nothing, sum(seq) AS total FROM telemetry GROUP BY 1"
    total = sum(seq for seq in range(21) if seq != 10) * 5
    assert desk.ask("query", sql) == [{"robot": "exo-01", "n": ROWS, "nothing": None, "total": total}]
    assert rows(desk.run("query", sql, "--csv")) == [
        ["robot", "n", "nothing", "total"],
        ["exo-01", str(ROWS), "", str(total)],
    ]
    assert desk.run("query", sql).splitlines()[1].split() == ["exo-01", str(ROWS), "–", str(total)]
    assert desk.ask("query", "SELECT * FROM labels WHERE label = 'x'") == []
    assert "LINE 1" in desk.run("query", "SELECT nothing FROM telemetry", status=1)


def test_a_query_shows_whatever_sql_makes(desk: Desk) -> None:
    desk.record()
    sql = "SELECT [1, 2] AS a, {'a': 'x,\"y'} AS b, DATE '2026-11-21' AS c, INTERVAL 3 DAYS AS d, true AS e"
    shown = ["[1,2]", '{"a":"x,\\"y"}', "2026-11-21", "[0,3,0]", "true"]
    assert rows(desk.run("query", sql, "--csv"))[1] == shown
    assert desk.run("query", sql).lower().splitlines()[1].split() == shown


def test_upkeep_leaves_a_store_of_one_writer_to_it(desk: Desk) -> None:
    Store(desk.url, several_writers=False)
    assert "is for one writer alone" in desk.run("cloud", "compact", status=1)
    assert desk.ask("cloud", "compact", "--alone") == []


def rows(text: str) -> list[list[str]]:
    return list(csv.reader(text.splitlines()))


def test_the_store_is_browsed(desk: Desk) -> None:
    recorded = desk.record()
    assert {each["table"]: each["rows"] for each in desk.ask("cloud", "ls")} == {
        "telemetry": ROWS, "sessions": 2, "events": 2, "labels": 1
    }  # fmt: skip
    assert recorded.session in desk.run("cloud", "ls", "--path", "telemetry/000")
    first = desk.ask("cloud", "du")["tables"][0]
    assert (first["table"], first["robot"], first["rows"]) == ("telemetry", "exo-01", ROWS)
    assert desk.run("cloud", "verify").endswith("all 105 rows of 1 batch by their receipts\n")
    [file] = Path(desk.url.removeprefix("file://"), "telemetry/000").rglob("*.parquet")
    file.unlink()
    assert "with 100 rows" in desk.ask("cloud", "verify", status=1)["problems"][0]


def test_what_waits_is_uploaded_once(desk: Desk) -> None:
    recorded = desk.record(sent=False)
    assert desk.ask("cloud", "upload") == {"uploaded": 1, "waiting": 0}
    desk.record(sent=False)
    assert "1 batch uploaded to" in desk.run("cloud", "upload")
    assert desk.ask("cloud", "upload") == {"uploaded": 0, "waiting": 0}
    assert recorded.store.dataset("telemetry/000").count_rows() == 2 * ROWS


def test_a_spool_that_another_server_owns_is_left_alone(desk: Desk) -> None:
    desk.record(sent=False)
    with Spool(desk.spool):
        assert "another server records into" in desk.run("cloud", "upload", status=1)


@pytest.fixture
def problem() -> str | None:
    """Why the collector could not upload."""
    return None


@pytest.fixture
def collector(desk: Desk, problem: str | None) -> Iterator[list[bytes]]:
    """Answers as one that runs on the spool would; what it was asked."""
    asked: list[bytes] = []
    status = json.dumps({"version": "1", "uploader": {"uploaded": 0, "problem": problem}}).encode() + b"\n"

    class Handler(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            asked.append(self.rfile.readline())
            self.wfile.write(b"3\n" if b"upload" in asked[-1] else status)

    desk.spool.mkdir(exist_ok=True)
    with socketserver.UnixStreamServer(str(desk.spool / NAME), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield asked
        server.shutdown()
        thread.join()


def test_a_collector_that_runs_is_asked_to_upload(desk: Desk, collector: list[bytes]) -> None:
    assert desk.ask("cloud", "upload") == {"uploaded": 0, "waiting": 3}
    assert collector == [b'{"ask":"upload"}\n', b'{"ask":"status"}\n']
    assert "owns the spool" in desk.run("cloud", "upload", desk.url, status=1)


@pytest.mark.parametrize("problem", ["Permission denied"])
@pytest.mark.parametrize("command", [("cloud", "upload"), ("collect", "--upload")])
@pytest.mark.usefixtures("collector")
def test_a_collector_that_cannot_upload_is_told_with_the_exit_status(
    desk: Desk, command: tuple[str, ...]
) -> None:
    assert "could not the last time: Permission denied" in desk.run(*command, status=1)


def test_a_store_moves_to_another_url_and_back_in_parts(desk: Desk, tmp_path: Path) -> None:
    recorded = desk.record()
    desk.record("exo-02")
    moved = (tmp_path / "moved").as_uri()
    assert desk.ask("cloud", "upload", moved, "--from", desk.url)["files"] > 8
    assert desk.ask("cloud", "upload", moved, "--from", desk.url)["files"] == 0
    done = desk.ask("cloud", "download", moved, "--out", str(tmp_path / "part"), "--robot", "*1")
    assert done == {"sessions": 1, "rows": ROWS}
    found = desk.ask("sessions", "ls", "--url", (tmp_path / "part").as_uri())
    assert [each["session"] for each in found] == [recorded.session]
    assert desk.run("cloud", "verify", moved).startswith(f"{moved} is whole")


def test_upkeep_tells_what_it_would_do_and_leaves_what_a_model_names(
    desk: Desk, capsys: pytest.CaptureFixture[str]
) -> None:
    recorded = desk.record()
    desk.record()
    version = recorded.store.table("events").version()
    pin(recorded.store, "events", version, "gait-3")
    plan, done = desk.ask("cloud", "compact", "--dry-run"), desk.ask("cloud", "compact")
    assert plan == done
    assert {each["location"]: each["files_after"] for each in done}["events"] == 1
    plan = desk.ask("cloud", "vacuum", "--grace", "0", "--dry-run")
    assert plan == desk.ask("cloud", "vacuum", "--grace", "0")
    assert not any("events/" in name for name in plan["files"])
    assert any("labels/" in name for name in plan["files"])
    assert recorded.store.dataset("events", version).count_rows() == 4
    for days in ("-1", "nan", "1e9", "week"):
        with pytest.raises(SystemExit):
            desk.run("cloud", "retain", "--days", days)
        assert f"{days!r} is no number of days: write a number from 0 to" in capsys.readouterr().err
    assert "There is no terminal to ask on" in desk.run("cloud", "retain", "--days", "0", status=1)
    assert desk.ask("cloud", "retain", "--days", "0", "--dry-run") == {"telemetry/000": 2 * ROWS}
    assert desk.ask("cloud", "retain", "--days", "0", "--yes") == {"telemetry/000": 2 * ROWS}
    assert Store(desk.url).dataset("telemetry/000").count_rows() == 0
