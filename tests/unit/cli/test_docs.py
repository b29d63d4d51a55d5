"""`gwrms docs`, and what help and messages point at: it is there wherever GWRMS is installed."""

import ast
import functools
import re
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway import pages
from gateway.main import main
from hil_sim.scenario.shipped import shipped
from tests.support.extras import ROOT

PARTS = ("gwrms", "gateway", "drivers", "eds", "server_gui", "ml", "hil_sim")
OF_THE_TREE = re.compile(r"\b(?:docs|scenarios|tests|tools)/\w|\./dev\b|CONTRIBUTING")
# One of them is in all that is looked for, also where a text is split between a word and the next.
LIKELY = re.compile(r"\bdocs\b|\b(?:scenarios|tests|tools)\b(?:/|[\"'])|\./dev\b|CONTRIBUTING")
NAMED = re.compile(r"gwrms docs ([a-z][a-z/-]*[a-z])(?: and ([a-z-]+))?")


@functools.cache
def said() -> list[tuple[Path, str]]:
    """Every text of our code that is no docstring, in files that may point at one of the tree."""
    return list(_said())


def _said() -> Iterator[tuple[Path, str]]:
    for part in PARTS:
        for file in (ROOT / part).rglob("*.py"):
            source = file.read_text(encoding="utf-8")
            if not LIKELY.search(source):
                continue
            tree = ast.parse(source)
            alone = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
            for node in ast.walk(tree):
                if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in alone:
                    yield file, node.value


def test_no_message_points_at_a_file_that_only_a_working_copy_has() -> None:
    assert [(file, text) for file, text in said() if OF_THE_TREE.search(text)] == []


def test_every_page_that_a_message_names_is_there() -> None:
    wanted = {name for _, text in said() for found in NAMED.findall(text) for name in found if name}
    assert {"scenarios", "predict", "wire-a-joint", "wire-a-sensor"} <= wanted
    assert [name for name in wanted if pages.find(name) is None] == []


def test_one_word_names_one_page() -> None:
    words = [name.rpartition("/")[2] for name in pages.pages() if name != "adr/index"]
    assert len(set(words)) == len(words)


@pytest.mark.parametrize("name", ["predict", "how-to/predict", "docs/how-to/predict.md", "how-to/predict.md"])
def test_a_page_is_printed_by_its_name(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["docs", name]) == 0
    assert capsys.readouterr().out == (ROOT / "docs/how-to/predict.md").read_text(encoding="utf-8")


def test_all_pages_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["docs"]) == 0
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines()[1:]]
    assert len(listed) == len(list((ROOT / "docs").rglob("*.md")))
    assert "tutorial/first-walk" in listed


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("predikt", "there is no page 'predikt'; did you mean predict"),
        ("scenario", "did you mean scenarios? all are listed by gwrms docs"),
        ("how-to/scenario", "did you mean scenarios? all are listed by gwrms docs"),
        ("reset", "there is no page 'reset'; did you mean explanation/stop (Stop, reset, enable)?"),
        ("zzzz", "there is no page 'zzzz'; all are listed by gwrms docs"),
    ],
)
def test_a_page_that_is_not_meant_clearly(name: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["docs", name]) == 1
    assert words in capsys.readouterr().err


def test_pip_is_shown_with_an_environment_to_install_into() -> None:
    shown = [
        page for page in [*pages.pages().values(), ROOT / "README.md"] if "pip install" in page.read_text()
    ]
    assert shown
    for page in shown:
        assert re.search(r"-m venv |\bpipx install", page.read_text(encoding="utf-8")), page


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[zipfile.ZipFile]:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (file,) = folder.glob("*.whl")
    with zipfile.ZipFile(file) as opened:
        yield opened


def test_pages_and_scenarios_are_in_what_is_installed(wheel: zipfile.ZipFile) -> None:
    files = set(wheel.namelist())
    assert {f"gateway/docs/{page}.md" for page in pages.pages()} <= files
    assert {f"hil_sim/scenarios/{name}.toml" for name in shipped()} <= files
    window = ROOT / "docs/reference/window.md"
    assert wheel.read("gateway/docs/reference/window.md") == window.read_bytes()


def test_only_our_parts_are_installed(wheel: zipfile.ZipFile) -> None:
    tops = {name.partition("/")[0] for name in wheel.namelist()}
    assert {top for top in tops if not top.startswith("gwrms-")} == set(PARTS)


def test_the_package_introduces_itself(wheel: zipfile.ZipFile) -> None:
    (file,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    told, _, introduction = wheel.read(file).decode().partition("\n\n")
    assert "Description-Content-Type: text/markdown" in told
    assert introduction == (ROOT / "README.md").read_text(encoding="utf-8")
