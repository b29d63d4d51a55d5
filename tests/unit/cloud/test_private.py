"""What a store names is written beneath its folder only; what is known of a wearer is for its owner alone."""

import contextlib
import importlib
import os
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from ml.store import Store, StoreError
from ml.store.objects import Object, Objects
from ml.store.private import closed_folder, opener, private_folder
from ml.store.tables import EVENTS
from server_gui.core.atomic_files import draft
from server_gui.core.cloud import transfer
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from tests.support.waiting import WAIT_S
from tests.unit.recording.robots import batch

KEYS = [
    "../out",
    "a/../../out",
    "/out",
    "a//b",
    "./a",
    "a\\..\\out",
    "a\0b",
    "a\nb",
    "",
    "..",
    "link/out",
    "a/..",
]


class Lying:
    """A store that somebody else can write to."""

    url = "s3://lab/exo"

    def __init__(self, objects: Mapping[str, bytes]) -> None:
        self._objects = objects

    def listing(self) -> Iterator[Object]:
        return (Object(key, len(data), "", 0.0) for key, data in self._objects.items())  # type: ignore[arg-type]

    def pieces(self, found: Object, begin: int = 0) -> Iterator[bytes]:
        yield self._objects[found.path][begin:]

    def read(self, path: str) -> bytes | None:
        return self._objects.get(path)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "to"
    folder.mkdir()
    (tmp_path / "elsewhere").mkdir()
    (folder / "link").symlink_to(tmp_path / "elsewhere")
    return folder


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("key", KEYS)
def test_an_object_that_is_no_file_beneath_the_folder_is_refused_before_anything_is_written(
    folder: Path, key: str
) -> None:
    source, target = Lying({"good": b"1", key: b"evil"}), Objects(folder.as_uri())
    with pytest.raises(StoreError, match="is no file beneath"):
        transfer.missing(source, target)  # type: ignore[arg-type]
    with pytest.raises(StoreError, match="is no file beneath"):
        transfer.copy(source, target, [Object(key, 4, "", 0.0)], lambda _: None)  # type: ignore[arg-type]
    assert files(folder.parent) == set()


def test_a_link_where_an_object_is_to_be_is_not_followed(folder: Path, tmp_path: Path) -> None:
    (folder / "good.part").symlink_to(tmp_path / "elsewhere" / "secret")
    target = Objects(folder.as_uri())
    with pytest.raises(StoreError):
        transfer.copy(Lying({"good": b"1"}), target, [Object("good", 1, "", 0.0)], lambda _: None)  # type: ignore[arg-type]
    assert files(tmp_path / "elsewhere") == set()


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def opened(folder: Path) -> dict[str, int]:
    """Whatever others may do something with."""
    found = [folder, *folder.rglob("*")]
    return {str(path): mode(path) for path in found if mode(path) & 0o077 and not path.is_symlink()}


@pytest.fixture
def usual_umask() -> Iterator[None]:
    before = os.umask(0o022)
    yield
    os.umask(before)


@pytest.mark.usefixtures("usual_umask")
def test_a_spool_is_for_its_owner_alone_also_one_that_was_open(tmp_path: Path) -> None:
    (tmp_path / "spool").mkdir(0o755)
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool, Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(0))
        assert recorder.flush(WAIT_S)
        assert opened(tmp_path / "spool") == {}
    assert opened(tmp_path / "spool") == {}


@pytest.mark.usefixtures("usual_umask")
def test_a_folder_that_is_made_and_a_draft_are_for_their_owner_alone(tmp_path: Path) -> None:
    private_folder(tmp_path / "a" / "b")
    with draft(tmp_path / "a" / "out.csv") as written:
        written.write_text("x")
    assert opened(tmp_path / "a") == {}
    (tmp_path / "shared").mkdir(0o755)
    private_folder(tmp_path / "shared")
    assert mode(tmp_path / "shared") == 0o755
    closed_folder(tmp_path / "shared")
    assert mode(tmp_path / "shared") == 0o700
    with open(tmp_path / "new", "w", opener=opener):
        pass
    assert mode(tmp_path / "new") == 0o600


@pytest.mark.usefixtures("usual_umask", "folder_url")
def test_the_folder_of_a_store_is_for_its_owner_alone(tmp_path: Path) -> None:
    row = EVENTS.rows([{"robot": "exo-01", "kind": "marker"}])
    Store((tmp_path / "data" / "store").as_uri()).append(EVENTS, "events", row.schema, row.to_reader, "s", 1)
    assert mode(tmp_path / "data") == mode(tmp_path / "data" / "store") == 0o700


COMMANDS = (
    *("cloud", "collect", "evaluate", "gui", "label"),
    *("models", "predict", "query", "sessions", "train"),
)


@pytest.mark.usefixtures("usual_umask")
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_that_writes_makes_private_files(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Also what libraries make, such as a table's log: by the process's own mask."""
    with contextlib.suppress(SystemExit):
        importlib.import_module(f"server_gui.cli.{name}").main(["--help"])
    assert "usage" in capsys.readouterr().out
    assert os.umask(0o022) == 0o077
