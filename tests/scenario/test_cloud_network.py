"""The store's commands where keys are wrong and the network is slow or not there: words, no keys, no loss."""

import contextlib
import itertools
import json
import logging
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.main import main
from ml.store import Store
from server_gui.core.cloud import verify
from tests.slow_network import SlowNetwork
from tests.stores import KEY, SECRET, SeaweedFS
from tests.unit.cloud.recordings import BATCHES, ROWS, record

MY_SECRET = "wJalrXUtnFEMI-example-secret"
READING = (
    ("sessions", "ls", "--url"),
    ("query", "SELECT * FROM events", "--url"),
    ("cloud", "ls"),
    ("cloud", "verify"),
    ("cloud", "compact"),
    ("cloud", "download", "--out", "{folder}"),
    ("cloud", "upload"),
    ("cloud", "upload", "--from", "{folder}", "{url}"),
)
Run = Callable[..., str]
pytestmark = [pytest.mark.parametrize("backend", ["s3"], indirect=True)]


@pytest.fixture
def fail(
    tmp_path: Path,
    store_url: str,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> Run:
    """Run a command that cannot succeed; everything that it says."""
    caplog.set_level(logging.DEBUG)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))

    def run(*words: str) -> str:
        assert main([*words, "--debug"]) == (2 if "verify" in words else 1)  # 1 of verify: it is not whole
        said = capsys.readouterr()
        return said.out + said.err + caplog.text

    return run


@pytest.mark.parametrize("words", READING, ids=" ".join)
def test_wrong_keys_are_refused_in_words_and_shown_nowhere(
    backend: SeaweedFS,
    store_url: str,
    fail: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
) -> None:
    local = record(
        (tmp_path / "store").as_uri(), tmp_path / "data" / "gwrms" / "spool", sent="{url}" in words
    )
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", MY_SECRET)
    named = [
        word.format(folder=local.store.url if "{url}" in words else tmp_path / "to", url=store_url)
        for word in words
    ]
    said = fail(*named, *([] if "{url}" in words else [store_url]))
    assert "check AWS_PROFILE, or AWS_ACCESS_KEY_ID" in said
    for key in (MY_SECRET, SECRET, KEY):
        assert key not in said


def test_no_network_is_said_soon(store_url: str, fail: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    said = fail("cloud", "ls", store_url)
    assert "check the network, AWS_ENDPOINT_URL and that the service runs" in said
    assert SECRET not in said


def test_a_download_over_a_slow_network_that_goes_away_is_completed_by_the_same_command(
    backend: SeaweedFS,
    store_url: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    record(store_url, tmp_path / "spool")
    words = ["cloud", "download", store_url, "--out", str(tmp_path / "copy"), "--json"]
    with SlowNetwork(backend.port, delay_s=0.01) as network, contextlib.ExitStack() as goes_away:
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{network.port}")
        goes_away.callback(network.close)
        monkeypatch.setattr("os.fsync", _at_call(3, goes_away.close))
        assert main(words) == 1
        assert "check the network" in capsys.readouterr().err
    assert not (tmp_path / "copy" / "store.json").exists()
    with SlowNetwork(backend.port, delay_s=0.01) as network:
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{network.port}")
        assert main(words) == 0
    done = json.loads(capsys.readouterr().out)
    assert (
        done["files"] == 4 * 3 + 1 - 3
    )  # a file and two log entries a table, and what says what the store is
    assert done["by_checksum"] == done["files"]
    copied = Store.existing((tmp_path / "copy").as_uri())
    assert list(verify.damages(copied, verify.files(copied), lambda _: None, deep=True)) == []
    assert copied.dataset("telemetry/000").count_rows() == BATCHES * ROWS


def _at_call(number: int, then: Callable[[], None]) -> Callable[[int], None]:
    """Like `os.fsync`, and before that call something happens."""
    calls = itertools.count(1)
    fsync = os.fsync

    def made(descriptor: int) -> None:
        if next(calls) == number:
            then()
        fsync(descriptor)

    return made
