"""How a store is reached, in words: where its keys come from, and never what they are."""

from pathlib import Path

import pytest

from server_gui.core.cloud.credentials import endpoint_told, keys_told

URL = "s3://lab/exo"
SECRET = "wJalrXUtnFEMI"


@pytest.fixture(autouse=True)
def no_keys(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_PROFILE", "AWS_ENDPOINT_URL"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("AWS_CONFIG_FILE", str(tmp_path / "config"))
    monkeypatch.setenv("AWS_SHARED_CREDENTIALS_FILE", str(tmp_path / "credentials"))


def test_a_folder_needs_none() -> None:
    assert keys_told("file:///srv/store") == "none needed: it is a folder"
    assert endpoint_told("file:///srv/store") == "this computer"


def test_none_says_what_to_set() -> None:
    assert "AWS_PROFILE" in keys_told(URL)
    assert endpoint_told(URL) == "Amazon S3"


def test_those_of_the_environment_are_named_and_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "AKIAIOSFODNN7")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", SECRET)
    monkeypatch.setenv("AWS_ENDPOINT_URL", "https://s3.lab.example")
    assert keys_told(URL) == "from the environment (AWS_ACCESS_KEY_ID)"
    assert endpoint_told(URL) == "https://s3.lab.example"


def test_those_of_a_profile_are_named_and_not_shown(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("AWS_PROFILE", "lab")
    (tmp_path / "credentials").write_text(
        f"[lab]\naws_access_key_id = AKIAIOSFODNN7\naws_secret_access_key = {SECRET}\n"
    )
    (tmp_path / "config").write_text("[profile lab]\nendpoint_url = https://s3.lab.example\n")
    assert keys_told(URL) == "from the profile 'lab' of AWS"
    assert endpoint_told(URL) == "https://s3.lab.example"
