"""Labels found elsewhere, and `gwrms label` as a command."""

import json
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec
import numpy as np
import pytest

from gateway import main
from ml.store import Store
from ml.store.labels import Label, LabelSource
from ml.store.sessions import Session, find
from ml.training.recorded import recorded
from server_gui.core.archive.label_sources import from_events, from_table, from_truth
from server_gui.core.archive.labelling import BadLabel
from server_gui.core.recording import records
from server_gui.core.recording.records import Facts
from server_gui.core.recording.rows import Layout, Run
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send

MS, S = 10**6, 10**9
BEGAN_UTC, BEGAN = 1_800_000_000 * S, 7_000 * S
ROWS = 1_000  # a hundred a second
STRIDE_S = 1.0
SESSION = "20270115T080000Z-abcdef"
CHANNELS = ("left_insole.force", "right_insole.force")


@pytest.fixture
def store(folder_url: str, tmp_path: Path) -> Store:
    """With a session of ten seconds in which somebody walks, as insoles see it."""
    steps = np.arange(ROWS) / 100 / STRIDE_S
    forces = [600.0 * ((steps + shift) % 1.0 < 0.6) for shift in (0.0, 0.5)]
    stamps = BEGAN + 10 * MS * np.arange(ROWS, dtype=np.int64)
    offset = np.full(ROWS, BEGAN_UTC - BEGAN, np.int64)
    layout = Layout(CHANNELS, ("N", "N"))
    numbers = np.arange(ROWS, dtype=np.int64)
    run = Run("exo", SESSION, "c", 1, layout, stamps, numbers, numbers * 0, offset, np.array(forces))
    session = records.Session("exo", SESSION, BEGAN_UTC, Facts(), BEGAN_UTC + ROWS * 10 * MS)
    store = Store(folder_url)
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool:
        spool.append([run], [session.record()])
        spool.freeze()
        send(spool, 1, store)
    return store


@pytest.fixture
def session(store: Store) -> Session:
    return find(store, SESSION)


@pytest.fixture
def config(store: Store, tmp_path: Path) -> str:
    file = tmp_path / "server.toml"
    file.write_text(f'[store]\nurl = "{store.url}"\n[recorder]\nspool = "{tmp_path / "spool"}"\n')
    return str(file)


def at(seconds: float) -> int:
    return BEGAN_UTC + round(seconds * 1000) * MS


def truth(path: Path, lines: Sequence[tuple[float, str, list[str]]], began: int = BEGAN) -> Path:
    header = {"columns": ["simulated_ns", "monotonic_ns", "label", "events"]}
    rows = [[0, began + round(second * S), name, events] for second, name, events in lines]
    path.write_text("".join(json.dumps(row) + "\n" for row in [header, *rows]))
    return path


def test_the_clocks_are_brought_together_to_the_nanosecond(store: Store) -> None:
    rows = recorded(store, "exo", SESSION, CHANNELS)
    stamps = BEGAN + np.array([0, 1, 5 * S + 1, 9_990 * MS, 11 * S], np.int64)
    assert (rows.to_utc(stamps) == stamps - BEGAN + BEGAN_UTC).all()
    assert (rows.at_utc(rows.to_utc(stamps)) == stamps).all()
    assert rows.values.shape == (ROWS, 2)


def test_the_simulators_truth_becomes_stretches_and_instants(
    store: Store, session: Session, tmp_path: Path
) -> None:
    lines = [
        (-1.0, "sit", []),
        (0.5, "sit", []),
        (1.0, "walk", ["left_heel_strike"]),
        (1.5, "walk", []),
        (2.0, "stand", []),
        (3.0, "stand", []),
        (60.0, "sit", []),
    ]
    found = from_truth(store, session, truth(tmp_path / "truth.jsonl", lines))
    told = [(each.label, each.began_utc_ns, each.ended_utc_ns) for each in sorted(found)]
    assert told == [
        ("sit", at(0.5), at(1.0)),
        ("left_heel_strike", at(1.0), at(1.0)),
        ("walk", at(1.0), at(2.0)),
        ("stand", at(2.0), at(3.0)),
    ]
    assert {each.source for each in found} == {LabelSource.SIMULATOR}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "cannot be read: No such file"),
        ("", "is no truth of gwrms sim"),
        ("[]\n", "is no truth of gwrms sim"),
        ('{"columns": ["monotonic_ns", "label"]}\n', "is no truth of gwrms sim"),
        ('{"columns": ["monotonic_ns", "label", "events"]}\n[1]\n', "is no truth of gwrms sim"),
        (
            '{"columns": ["monotonic_ns", "label", "events"]}\n[1, "sit", []]\n',
            "must be of the same time, and of a simulator on the robot's own computer",
        ),
    ],
)
def test_what_is_no_truth_of_this_session_is_refused(
    store: Store, session: Session, tmp_path: Path, content: str | None, words: str
) -> None:
    path = tmp_path / "truth.jsonl"
    if content is not None:
        path.write_text(content)
    with pytest.raises(BadLabel, match=words):
        from_truth(store, session, path)


def test_steps_that_the_recording_shows_become_instants(store: Store, session: Session) -> None:
    found = from_events(store, session)
    strikes = [each.began_utc_ns for each in found if each.label == "left_heel_strike"]
    assert np.diff(strikes) == pytest.approx(STRIDE_S * S, abs=20 * MS)
    assert len(strikes) >= 8
    assert {each.source for each in found} == {LabelSource.SENSORS}


def test_a_table_names_the_line_that_is_wrong(session: Session, tmp_path: Path) -> None:
    path = tmp_path / "labels.csv"
    path.write_text("from,to,label,remark\n1,2.5,walk,\n3,,left_heel_strike,late\n")
    assert from_table(session, path, "ada", seconds) == [
        Label("exo", SESSION, at(1), at(2.5), "walk", "ada"),
        Label("exo", SESSION, at(3), at(3), "left_heel_strike", "ada"),
    ]
    path.write_text("from,to,label\n1,2,walk\nsoon,4,sit\n")
    with pytest.raises(BadLabel, match=r"labels\.csv, line 3: could not convert"):
        from_table(session, path, "ada", seconds)
    path.write_text("from,label\n")
    with pytest.raises(BadLabel, match="has no column to; it needs from,to,label"):
        from_table(session, path, "ada", seconds)


def seconds(text: str) -> datetime:
    return datetime.fromtimestamp(BEGAN_UTC / S, UTC) + timedelta(seconds=float(text))


def test_the_command_labels_lists_and_takes_back(config: str, capsys: pytest.CaptureFixture[str]) -> None:
    def run(*arguments: str) -> str:
        assert main.main(["label", SESSION[:8], "--config", config, *arguments]) == 0
        return capsys.readouterr().out

    assert run("walk", "--from", "1", "--to", "2027-01-15T08:00:02") == "1 label kept in the store\n"
    assert "1 was so already" in run("walk", "--from", "1", "--to", "2")
    run("--wearer", "P03")
    (wearer, walk) = msgspec.json.decode(run("--ls", "--json"), type=list[Label])
    assert (wearer.label, walk.label) == ("wearer P03", "walk")
    assert (walk.began_utc_ns, walk.ended_utc_ns) == (at(1), at(2))
    assert "walk        2027-01-15 08:00:01.000" in run("--ls")
    assert run("walk", "--from", "1", "--to", "2", "--remove") == "1 taken back\n"
    assert "walk" not in run("--ls")
    assert json.loads(run("--gait-events", "--json"))["new"] > 30


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["--from", "1"], 2, "give LABEL and --from, or one of"),
        (["walk", "--from", "soon"], 2, "'soon' is no time"),
        (["walk", "--from", "1", "--to", "100"], 1, "lies outside the session"),
        (["walk", "--from", "100"], 1, "lies outside the session"),
        (["walk", "--from", "1"], 1, "has no length"),
        (["walk", "--from", "1", "--to", "2", "--remove"], 1, "is no label of"),
        (["wlak", "--from", "1", "--to", "2"], 0, "no model learns from 'wlak'; did you mean walk? gwrms"),
    ],
)
def test_the_command_says_what_is_wrong(
    config: str, capsys: pytest.CaptureFixture[str], arguments: list[str], status: int, words: str
) -> None:
    try:
        ended: object = main.main(["label", SESSION, "--config", config, *arguments])
    except SystemExit as error:
        ended = error.code
    assert ended == status
    assert words in capsys.readouterr().err
