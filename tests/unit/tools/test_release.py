"""What a release is made of: a whole bill of materials, checksums, and two builds that agree."""

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

from gateway import __version__
from tools import release
from tools.sbom import OWN, bill, packages

LOCK = """\
can-line==1.2.0 ; python_full_version < '3.12' \\
    --hash=sha256:{one} \\
    --hash=sha256:{two}
    # via gwrms (pyproject.toml)
can-line==1.3.0 ; python_full_version >= '3.12' \\
    --hash=sha256:{two}
    # via gwrms (pyproject.toml)
wrapt==2.0
    # via
    #   can-line
    #   gwrms (pyproject.toml)
""".format(one="1" * 64, two="2" * 64)


def test_every_package_is_in_the_bill_with_checksums_and_what_needs_it() -> None:
    made = bill("0.2.0", 1_795_000_000, LOCK)
    first, second, third = made["components"]
    assert (made["bomFormat"], made["specVersion"], first["purl"]) == (
        "CycloneDX",
        "1.5",
        "pkg:pypi/can-line@1.2.0",
    )
    assert [one["content"] for one in first["externalReferences"][0]["hashes"]] == ["1" * 64, "2" * 64]
    assert first["properties"][0]["value"] == "python_full_version < '3.12'"
    assert "properties" not in third
    needs = {one["ref"]: one["dependsOn"] for one in made["dependencies"]}
    assert needs["pkg:pypi/gwrms@0.2.0"] == [first["purl"], second["purl"], third["purl"]]
    assert needs[first["purl"]] == needs[second["purl"]] == [third["purl"]]
    assert needs[third["purl"]] == []
    assert bill("0.2.0", 1_795_000_000, LOCK) == made


def test_what_cannot_be_read_of_a_lock_file_is_left_out_by_nobody() -> None:
    with pytest.raises(ValueError, match="line 1 of the lock file"):
        packages("wrapt @ https://example.org/wrapt.whl\n")


def test_the_own_lock_file_is_read_whole() -> None:
    lock = release.LOCK.read_text(encoding="utf-8")
    found = packages(lock)
    assert len(found) == sum("==" in line and not line.startswith(" ") for line in lock.splitlines())
    assert all(package.hashes and package.via for package in found)
    assert {by for package in found for by in package.via} <= {OWN, *(package.name for package in found)}


def test_two_builds_that_differ_are_no_release(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(release, "_git", lambda *words: "1795000000" if words[0] == "log" else "")
    monkeypatch.setattr(release, "_built", lambda _epoch_s, mask: {"gwrms.whl": b"%o" % mask})
    assert release.main([str(tmp_path)]) == 1
    assert "NOT REPRODUCIBLE: gwrms.whl" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []


def test_checksums_are_of_all_files_and_nobody_having_looked_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(release, "_git", lambda *words: "1795000000" if words[0] == "log" else "")
    monkeypatch.setattr(release, "_built", lambda _epoch_s, _mask: {"gwrms.whl": b"the same"})
    monkeypatch.setattr("importlib.util.find_spec", _nothing)
    assert release.main([str(tmp_path)]) == 0
    assert "NOBODY HAS LOOKED" in capsys.readouterr().out
    told = [line.split("  ") for line in (tmp_path / release.SUMS).read_text().splitlines()]
    lines = {name: checksum for checksum, name in told}
    named = {file.name for file in tmp_path.iterdir()} - {release.SUMS}
    assert lines == {name: hashlib.sha256((tmp_path / name).read_bytes()).hexdigest() for name in named}
    assert json.loads((tmp_path / f"gwrms-{__version__}.cdx.json").read_bytes())["components"]


def _nothing(_name: str) -> Any:
    return None
