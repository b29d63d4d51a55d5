"""A store that cannot be reached or refuses says so in words, soon, and without anybody's keys."""

import http.server
import logging
import threading
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

import pytest
from obstore.exceptions import GenericError

from ml.store import Store, StoreError, StoreRefused, StoreUnreachable, UnsafeStore
from ml.store.objects import Objects
from ml.store.tables import EVENTS
from ml.store.translation import translated
from tests.stores import SeaweedFS
from tests.support.waiting import WAIT_S

ROW = EVENTS.rows([{"robot": "exo-01", "kind": "marker"}])
MY_KEY, MY_SECRET = "AKIAEXAMPLEKEY", "wJalrXUtnFEMI-example-secret"


pytestmark = pytest.mark.usefixtures("store_libraries")


def refused(url: str) -> pytest.ExceptionInfo[StoreError]:
    with pytest.raises(StoreError) as said:
        Store(url)
    return said


@pytest.mark.parametrize("backend", ["s3"], indirect=True)
def test_wrong_keys_are_refused_in_words_without_the_keys(
    backend: SeaweedFS, store_url: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    store = Store(store_url)
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", MY_SECRET)
    with pytest.raises(StoreError) as of_a_table:
        store.table("events")
    for said in (refused(store_url), of_a_table):
        assert said.type is StoreRefused
        assert store_url in str(said.value)
        assert "check AWS_PROFILE" in str(said.value)
        everything = "".join(traceback.format_exception(said.value)) + caplog.text
        assert MY_SECRET not in everything
        assert "tests-key" not in everything


@pytest.mark.parametrize("backend", ["s3"], indirect=True)
def test_a_profile_gives_the_keys(
    backend: SeaweedFS, store_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = backend.environment
    (tmp_path / "credentials").write_text(
        f"[lab]\naws_access_key_id = {known['AWS_ACCESS_KEY_ID']}\n"
        f"aws_secret_access_key = {known['AWS_SECRET_ACCESS_KEY']}\n"
    )
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_SHARED_CREDENTIALS_FILE", str(tmp_path / "credentials"))
    monkeypatch.setenv("AWS_PROFILE", "lab")
    store = Store(store_url)
    assert store.append(EVENTS, "events", ROW.schema, ROW.to_reader, "spool-a", 1)
    assert store.dataset("events").count_rows() == 1


class FakeS3(http.server.BaseHTTPRequestHandler):
    """As much of S3 as the probe asks for; it takes any key, and ignores `If-None-Match` or races on it."""

    objects: ClassVar[dict[str, bytes]] = {}
    racers: ClassVar[threading.Barrier | None] = None
    failure: ClassVar[tuple[int, bytes] | None] = None

    def do_PUT(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        there = self.path in self.objects
        if self.racers is not None and body != b"late":  # everybody has looked before anybody writes
            self.racers.wait(WAIT_S)
            there = False
        refuse = self.racers is not None and there
        if not refuse:
            self.objects[self.path] = body
        self.answer(412 if refuse else 200)

    def do_GET(self) -> None:
        body = self.objects.get(self.path)
        self.answer(404 if body is None else 200, body or b"")

    def do_DELETE(self) -> None:
        self.objects.pop(self.path, None)
        self.answer(204)

    def do_POST(self) -> None:  # several objects are deleted by one POST
        self.rfile.read(int(self.headers["Content-Length"]))
        self.answer(200, b"<DeleteResult><Deleted><Key>x</Key></Deleted></DeleteResult>")

    def answer(self, status: int, body: bytes = b"") -> None:
        if self.failure is not None:
            status, body = self.failure
        self.send_response(status)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("ETag", '"1"')
        self.send_header("Last-Modified", "Sat, 21 Nov 2026 12:00:00 GMT")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *args: object) -> None:
        return


@pytest.fixture
def fake_s3(monkeypatch: pytest.MonkeyPatch) -> Iterator[type[FakeS3]]:
    class Handler(FakeS3):
        objects: ClassVar[dict[str, bytes]] = {}

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{server.server_port}")
        monkeypatch.setenv("AWS_ACCESS_KEY_ID", MY_KEY)
        monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", MY_SECRET)
        monkeypatch.setenv("AWS_REGION", "us-east-1")
        yield Handler
        server.shutdown()
        thread.join()


@pytest.mark.parametrize("racy", [False, True], ids=["ignores the condition", "races on it"])
def test_a_store_without_conditional_writes_is_refused_for_several_writers(
    fake_s3: type[FakeS3], racy: bool
) -> None:
    fake_s3.racers = threading.Barrier(4) if racy else None
    assert refused("s3://bucket/x").type is UnsafeStore
    fake_s3.racers = None
    assert Store("s3://bucket/x", several_writers=False).about.several_writers is False


def test_what_a_server_says_of_our_keys_is_not_passed_on(fake_s3: type[FakeS3]) -> None:
    body = f"<Error><Code>SignatureDoesNotMatch</Code><AWSAccessKeyId>{MY_KEY}</AWSAccessKeyId></Error>"
    for status, content in ((403, body.encode()), (403, MY_KEY.encode()), (500, MY_SECRET.encode())):
        fake_s3.failure = (status, content)
        text = "".join(traceback.format_exception(refused("s3://bucket/x").value))
        assert MY_KEY not in text
        assert MY_SECRET not in text


def test_no_network_is_said_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (
        ("ENDPOINT_URL", "http://127.0.0.1:9"),
        ("ACCESS_KEY_ID", "k"),
        ("SECRET_ACCESS_KEY", "s"),
    ):
        monkeypatch.setenv(f"AWS_{name}", value)
    said = refused("s3://bucket/x")
    assert said.type is StoreUnreachable
    assert "check the network, AWS_ENDPOINT_URL" in str(said.value)


def test_a_folder_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    said = refused((tmp_path / "file" / "store").as_uri())
    assert str(tmp_path / "file" / "store") in str(said.value)
    assert str(said.value).endswith("Not a directory; check the folder and its disk")


@pytest.mark.parametrize(
    "raised",
    [
        NotADirectoryError(20, "Not a directory", "/x/store.json#1763233"),
        GenericError("Generic LocalFileSystem error: Unable to walk dir: /x: Not a directory (os error 20)"),
    ],
)
def test_what_the_computer_says_of_a_folder_is_told_without_its_number(raised: Exception) -> None:
    with pytest.raises(StoreUnreachable) as said, translated("file:///x cannot be written"):
        raise raised
    assert str(said.value) == "file:///x cannot be written: Not a directory; check the folder and its disk"


def test_keys_are_in_no_object_of_ours(backend: SeaweedFS | None, store_url: str, tmp_path: Path) -> None:
    Store(store_url).append(EVENTS, "events", ROW.schema, ROW.to_reader, "spool-a", 1)
    objects = Objects(store_url)
    contents = [objects.read(name) for name in objects.names("")]
    assert contents
    for content in contents:
        assert content is not None
        assert b"tests-key" not in content
        assert b"tests-secret" not in content


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(28, "No space left on device"), "No space left on device; make room there"),
        (PermissionError(13, "Permission denied"), "Permission denied; this account must be allowed"),
        (OSError(111, "Connection refused"), "Connection refused; check the network"),
    ],
)
def test_advice_is_about_what_is_wrong(error: OSError, said: str) -> None:
    with pytest.raises(StoreError, match=said), translated("the store cannot be written"):
        raise error


def test_a_folder_that_is_not_there_is_empty_and_made_by_the_first_who_writes(tmp_path: Path) -> None:
    folder = tmp_path / "a b"
    one, other = Objects(folder.as_uri()), Objects(folder.as_uri())
    assert one.read("labels/x.json") is None
    assert one.names("labels") == []
    one.remove("labels/x.json")
    assert not folder.exists()
    assert one.create("labels/x.json", b"{}")
    assert other.read("labels/x.json") == b"{}"
    assert other.names("labels") == ["labels/x.json"]
