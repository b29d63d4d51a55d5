"""The store's settings are changed in the server's file: checked first, all else is kept."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from server_gui.core.settings.file_edits import change
from server_gui.core.settings.server_file import SettingsError, load
from server_gui.views.cloud.settings_form import SettingsForm
from server_gui.views.theme import Theme
from tests.gui.fakes import destroy

FILE = """# ours
[robots]
exo-01 = "192.0.2.7:7420"  # the bench

[store]
# where it goes
url = "s3://lab/old"  # since May
shards = 4

[recorder]
upload = 'idle'

[[rules]]
task = "falling"
label = "fall"
at_least = 0.9
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    made = tmp_path / "server.toml"
    made.write_text(FILE)
    made.chmod(0o600)
    return made


@pytest.fixture
def form(theme: Theme, file: Path) -> Iterator[SettingsForm]:
    made = SettingsForm(load(file), file)
    made.show()
    yield made
    destroy(made)


def test_only_what_was_edited_is_written_and_every_comment_stays(form: SettingsForm, file: Path) -> None:
    assert not form.save.isEnabled()
    form.url.setText("s3://lab/new")
    form.batch.setText("30")
    assert "[store] url, [recorder] batch_s is to be written" in form.said.text()
    form.save.click()
    assert form.said.text().startswith(f"Saved in {file}; takes effect when")
    wanted = FILE.replace('"s3://lab/old"', '"s3://lab/new"')
    assert file.read_text() == wanted.replace("upload = 'idle'\n", "upload = 'idle'\nbatch_s = 30.0\n")
    assert file.stat().st_mode & 0o777 == 0o600
    assert not form.save.isEnabled()
    assert [path.name for path in file.parent.iterdir()] == ["server.toml"]


@pytest.mark.parametrize(
    ("url", "batch", "said"),
    [
        ("ftp://lab", "60", "is no store: use file:///folder or s3://bucket/prefix"),
        ("s3://key:secret@lab", "60", "has no keys in it"),
        ("s3://lab/old", "0", "[recorder] batch_s: must be a number, at least 1"),
        ("s3://lab/old", "soon", "'soon' is not a number"),
        ("s3://lab/old", "nan", "no number that can be meant"),
    ],
)
def test_what_cannot_work_is_refused_with_the_reason_and_the_file_stays(
    form: SettingsForm, file: Path, url: str, batch: str, said: str
) -> None:
    form.url.setText(url)
    form.batch.setText(batch)
    form.save.click()
    assert form.said.text().startswith("NOT SAVED: ")
    assert said in form.said.text()
    assert file.read_text() == FILE
    assert form.save.isEnabled(), "it can be mended"


def test_a_file_that_is_not_there_is_made(tmp_path: Path) -> None:
    file = tmp_path / "gwrms" / "server.toml"
    change(file, {("store", "url"): "s3://lab/exo", ("recorder", "upload"): "manual"})
    assert load(file).store.url == "s3://lab/exo"
    assert load(file).recorder.upload.value == "manual"


@pytest.mark.parametrize(
    "text",
    [
        'store.url = "s3://lab/old"\n',
        'store = { url = "s3://lab/old" }\n',
        '[store]\nurl = """s3://\\\nlab/old"""\n',
    ],
)
def test_a_value_is_changed_however_it_is_written(tmp_path: Path, text: str) -> None:
    file = tmp_path / "server.toml"
    file.write_text(f"# ours\n{text}")
    change(file, {("store", "url"): "s3://lab/new"})
    assert load(file).store.url == "s3://lab/new"
    assert file.read_text().startswith("# ours\n")


@pytest.mark.parametrize("text", ["store = 3\n", "[[store]]\n", "[store\n"])
def test_a_file_that_cannot_be_changed_is_left_alone_and_it_says_what_to_do(
    tmp_path: Path, text: str
) -> None:
    file = tmp_path / "server.toml"
    file.write_text(text)
    with pytest.raises(SettingsError, match=r"change \[store\] url in it"):
        change(file, {("store", "url"): "s3://lab/new"})
    assert file.read_text() == text


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SettingsError, match="cannot be"):
        change(tmp_path / "file" / "server.toml", {("store", "url"): "s3://lab/exo"})
