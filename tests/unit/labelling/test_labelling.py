"""Labels: kept once wherever they come from, taken back, and refused where they cannot be so."""

import contextlib
import time
from pathlib import Path

import msgspec
import pytest

from ml.store import Store, StoreUnreachable
from ml.store.labels import Label, LabelSource, holding
from ml.store.query import query
from ml.store.sessions import NoSuchSession, rows_of
from ml.store.tables import LABELS
from server_gui.core.archive.labelling import AT_ONCE, BadLabel, Kept, Labelling, Where
from server_gui.core.fleet.collector import Collector
from server_gui.core.fleet.control_socket import NobodyCollects, ask
from server_gui.core.recording import records
from server_gui.core.recording.errors import RecordingError
from server_gui.core.recording.records import Facts
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings, Upload
from tests.support.waiting import until
from tests.unit.cloud.filled import Filled

S = 10**9
BEGAN = 1_800_000_000 * S
LENGTH = 60 * S
ROBOT, SESSION = "exo-01", "20270115T080000Z-abcdef"


def settings_in(folder: Path) -> ServerSettings:
    store = StoreSettings((folder / "store").as_uri())
    return ServerSettings({}, store, RecordingSettings(spool=folder / "spool", batch_s=1.0))


@pytest.fixture(scope="module")
def uploaded(store_libraries: None, tmp_path_factory: pytest.TempPathFactory) -> Filled:
    """Where a server has recorded a session of a minute, and uploaded it."""
    return Filled(tmp_path_factory.mktemp("labelled"), lambda folder: recorded(settings_in(folder)))


@pytest.fixture
def folder(request: pytest.FixtureRequest, tmp_path: Path, store_libraries: None) -> Path:
    """Of the server: empty, but for tests of what it has recorded."""
    has = "labelling" in request.fixturenames
    return request.getfixturevalue("uploaded").anew() if has else tmp_path


@pytest.fixture
def settings(folder: Path) -> ServerSettings:
    return settings_in(folder)


@pytest.fixture
def labelling(settings: ServerSettings) -> Labelling:
    """Of a server that has recorded a session of a minute, and uploaded it."""
    return Labelling(settings)


def recorded(settings: ServerSettings, *, sent: bool = True) -> None:
    session = records.Session(ROBOT, SESSION, BEGAN, Facts(), BEGAN + LENGTH)
    with Spool(settings.recorder.spool) as spool:
        spool.append((), [session.record()])
        spool.freeze()
        for number in spool.waiting() if sent else ():
            send(spool, number, Store(settings.store.url))


def label(name: str = "walk", begin: float = 10.0, end: float = 20.0, author: str = "ada") -> Label:
    return Label(ROBOT, SESSION, BEGAN + int(begin * S), BEGAN + int(end * S), name, author)


def manual(settings: ServerSettings) -> ServerSettings:
    by_hand = msgspec.structs.replace(settings.recorder, upload=Upload.MANUAL)
    return msgspec.structs.replace(settings, recorder=by_hand)


def held(labelling: Labelling) -> list[Label]:
    return labelling.ls(labelling.session(SESSION))


def rows(settings: ServerSettings) -> int:
    """How often anything was said about labels in the store."""
    store = Store(settings.store.url)
    return len(rows_of(store, Labelling(settings).session(SESSION), LABELS))


def test_a_label_of_an_uploaded_session_is_in_the_store_once(
    labelling: Labelling, settings: ServerSettings
) -> None:
    for new in (1, 0):
        kept = labelling.add(ROBOT, SESSION[:10], "walk", BEGAN + 10 * S, BEGAN + 20 * S, "ada")
        assert kept == Kept(new, 1 - new, Where.STORE)
    assert held(labelling) == [label()]
    assert rows(settings) == 1


def test_times_are_kept_as_the_store_has_them(labelling: Labelling) -> None:
    odd = Label(ROBOT, SESSION, BEGAN + 1_234_567_891, BEGAN + 2_345_678_912, "walk", "ada")
    labelling.add_all([odd])
    assert labelling.add_all([odd]).known == 1
    (kept,) = held(labelling)
    assert (kept.began_utc_ns, kept.ended_utc_ns) == (BEGAN + 1_234_567_000, BEGAN + 2_345_678_000)


def test_a_label_said_twice_at_once_is_one(settings: ServerSettings, labelling: Labelling) -> None:
    with Spool(settings.recorder.spool) as spool:
        for _ in range(2):
            spool.append((), [records.label(label())])
            spool.freeze()
        for number in spool.waiting():
            send(spool, number, Store(settings.store.url))
    assert rows(settings) == 2
    assert held(labelling) == [label()]


def test_a_session_that_waits_for_upload_can_be_labelled(settings: ServerSettings) -> None:
    settings = manual(settings)
    recorded(settings, sent=False)
    labelling = Labelling(settings)
    assert labelling.add_all([label()]).where is Where.SPOOL
    assert labelling.add_all([label()]) == Kept(0, 1, Where.STORE)
    assert held(labelling) == [label()]
    with Spool(settings.recorder.spool) as spool:
        for number in spool.waiting():
            send(spool, number, Store(settings.store.url))
    assert held(labelling) == [label()]
    assert rows(settings) == 1


def test_where_the_store_cannot_be_reached_labels_wait_in_the_spool(
    labelling: Labelling, settings: ServerSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr("server_gui.core.archive.labelling.send", refuse)
        kept = labelling.add_all([label()])
    assert (kept.where, kept.problem) == (Where.SPOOL, "no network")
    assert held(labelling) == [label()]
    labelling.add_all([label("sit", 30, 40)])  # brings what waited
    assert rows(settings) == 2


def refuse(*_: object) -> None:
    raise StoreUnreachable("no network")


def test_a_label_is_taken_back_and_can_be_given_again(labelling: Labelling, settings: ServerSettings) -> None:
    labelling.add_all([label(), label("sit", 30, 40)])
    labelling.remove(label())
    assert held(labelling) == [label("sit", 30, 40)]
    with pytest.raises(BadLabel, match=r"is no label of 20270115T080000Z-abcdef"):
        labelling.remove(label())
    labelling.add_all([label()])
    assert held(labelling) == [label(), label("sit", 30, 40)]
    assert rows(settings) == 4  # nothing was altered, all of it can be read again
    labelling.remove(label("sit", 30, 40))
    with query(Store(settings.store.url), "SELECT label FROM labels WHERE robot = 'exo-01'") as found:
        assert [row for batch in found.batches for row in batch.to_pylist()] == [{"label": "walk"}]


def test_a_collector_that_owns_the_spool_keeps_labels_and_uploads_them(
    labelling: Labelling, settings: ServerSettings
) -> None:
    many = [label("left_heel_strike", second / 3, second / 3) for second in range(AT_ONCE + 1)]
    with Collector(settings) as collector:
        until_it_answers(settings, collector)
        assert labelling.add_all(many) == Kept(len(many), 0, Where.SPOOL)
        assert held(labelling) == sorted(many)
        labelling.remove(many[0])
    assert held(labelling) == sorted(many[1:])
    assert rows(settings) == len(many) + 1


def test_what_a_collector_cannot_keep_is_an_error(
    labelling: Labelling, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server_gui.core.archive.labelling.ask", lambda *_: b"false\n")
    with pytest.raises(RecordingError, match="could not keep the labels"):
        labelling.add_all([label()])


def until_it_answers(settings: ServerSettings, collector: Collector) -> None:
    def answers() -> bool:
        with contextlib.suppress(NobodyCollects):
            return bool(ask(settings.recorder.spool, "status"))
        return False

    until(answers, "the collector answers", step=lambda: collector.wait(0.01))


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (label(end=10.0), r"walk at 2027-01-15 08:00:10.000 has no length"),
        (label(end=9.0), "has no length: it ends when, or before, it begins"),
        (
            label(begin=-1.0),
            "lies outside the session .* goes from 2027-01-15 08:00:00.000 to .*08:01:00.000",
        ),
        (label(end=61.0), "lies outside the session"),
        (label(begin=70.0, end=70.0), "lies outside the session"),
        (label("left_heel_strike"), "this happens at one instant"),
        (label("sit", 15, 25), r"sit from .* contradicts walk from .* by the same author"),
        (label("  "), "'  ' is no name"),
        (label("walk\n"), "is no name"),
        (label(author=""), "a label and its author have one"),
    ],
)
def test_what_cannot_be_so_is_refused_and_nothing_is_kept(
    labelling: Labelling, bad: Label, words: str
) -> None:
    labelling.add_all([label()])
    with pytest.raises(BadLabel, match=words):
        labelling.add_all([label("stand", 40, 50), bad])
    assert held(labelling) == [label()]


@pytest.mark.parametrize(
    "other",
    [
        label("sit", 15, 25, "bob"),  # two people may disagree
        label("sit", 20, 25),  # one after the other
        label("walk", 15, 25),  # says the same
        label("new insoles", 0, 60),  # no activity
        label("right_heel_strike", 15, 15),
        msgspec.structs.replace(label("sit", 15, 25), source=LabelSource.PSEUDO),
    ],
)
def test_what_contradicts_nobody_is_kept(labelling: Labelling, other: Label) -> None:
    labelling.add_all([label()])
    labelling.add_all([other])
    assert set(held(labelling)) == {label(), other}


def test_a_session_that_goes_on_is_labelled_up_to_now(settings: ServerSettings) -> None:
    now_ns = time.time_ns()
    going_on = records.Session(ROBOT, SESSION, now_ns - 10 * S, Facts())
    with Spool(settings.recorder.spool) as spool:
        spool.append((), [going_on.record()])
    labelling = Labelling(settings)
    labelling.add(ROBOT, SESSION, "walk", now_ns - 5 * S, now_ns, "ada")
    with pytest.raises(BadLabel, match="outside"):
        labelling.add(ROBOT, SESSION, "walk", now_ns - 5 * S, now_ns + 3600 * S, "ada")


def test_an_unknown_session_is_said_so(labelling: Labelling) -> None:
    with pytest.raises(NoSuchSession, match="has no session '2026'"):
        labelling.add(ROBOT, "2026", "walk", BEGAN, BEGAN + S, "ada")


def test_rows_from_before_there_was_taking_back_hold() -> None:
    old = label().row(0)
    del old["written"], old["removed"]
    assert holding([old | {"written": None, "removed": None}]) == [old | {"written": None, "removed": None}]
