"""Every defect that an explorer or the fuzzer is to find can still be put back into the code as it is."""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
LISTS = ("tests/explore/defects.toml", "tests/explore_store/defects.toml", "tests/fuzz/seeded.toml")


def parts(found: Any) -> Iterator[dict[str, str]]:
    """Each change of a text in a module."""
    if isinstance(found, dict) and "module" in found:
        yield found
    elif isinstance(found, dict | list):
        for each in found.values() if isinstance(found, dict) else found:
            yield from parts(each)


@pytest.mark.parametrize("name", LISTS)
def test_each_text_that_is_changed_is_there_once(name: str) -> None:
    listed = list(parts(tomllib.loads((ROOT / name).read_text(encoding="utf-8"))))
    assert listed
    for part in listed:
        file = ROOT / Path(*part["module"].split(".")).with_suffix(".py")
        assert file.read_text(encoding="utf-8").count(part["old"]) == 1, part
