"""The changelog has a section for this version, and one for what comes next."""

import re
from datetime import date
from pathlib import Path

import gateway

ROOT = Path(__file__).parents[2]
RELEASE = re.compile(r"(\d+\.\d+\.\d+) – (\d{4}-\d{2}-\d{2})")


def test_the_newest_release_is_this_version_and_dated() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    newest, *released = re.findall(r"^## (.+)$", text, re.MULTILINE)
    assert newest == "Unreleased"
    found = [RELEASE.fullmatch(each) for each in released]
    assert all(found), released
    told = [each.groups() for each in found if each]
    assert told[0][0] == gateway.__version__
    dates = [date.fromisoformat(day) for _, day in told]
    assert dates == sorted(dates, reverse=True)


def test_the_version_stands_in_one_place() -> None:
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert f'"{gateway.__version__}"' not in project
    named = [
        file
        for part in ("gwrms", "gateway", "drivers", "eds", "server_gui", "ml", "hil_sim")
        for file in (ROOT / part).rglob("*.py")
        if f'"{gateway.__version__}"' in file.read_text(encoding="utf-8")
    ]
    assert named == [ROOT / "gateway" / "__init__.py"]
