"""Layouts: what is saved is loaded again, and what is no layout says where."""

import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from server_gui.core.workspace.layouts import (
    Layout,
    LayoutError,
    Layouts,
    PlotLayout,
    TriggerLayout,
    decoded,
    encoded,
    read,
)
from server_gui.core.workspace.trigger import Mode, On
from tests.support.examples import examples

GOOD = """format = 1
name = "Knees"
span_s = 5.0

[[plot]]
curves = ["left_knee.position", "error = left_knee.position - left_knee.target"]

[[plot]]
curves = ["left_knee.position"]
x = "left_hip.position"
"""


@pytest.fixture
def layouts(tmp_path: Path) -> Layouts:
    return Layouts(tmp_path / "layouts")


def layout(name: str) -> Layout:
    trigger = TriggerLayout(On.ENTERS, "left_knee.torque", 1.0, 2.0, Mode.SINGLE, 0.25, 3.0)
    return Layout(name, [PlotLayout(["a.x", "b = a.x - a.y"]), PlotLayout(["a.y"], "a.x")], 30.0, trigger)


@given(
    name=st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Zs", "Zl", "Zp")), min_size=1)
    .map(lambda text: f"n{text}"[:60])
    .filter(str.isprintable),
    curves=st.lists(
        st.sampled_from(["a.x", "e = -a.x", '"q".x'[3:] + "a.x", "a.x * 2"]), min_size=1, max_size=4
    ),
    span_s=st.floats(0.5, 100),
    level=st.floats(-1e6, 1e6),
)
@settings(max_examples=examples(60), deadline=None)
def test_what_is_written_is_read_again(name: str, curves: list[str], span_s: float, level: float) -> None:
    curves = [curve for curve in curves if not curve.startswith(".")] or ["a.x"]
    told = Layout(name, [PlotLayout(curves)], span_s, TriggerLayout(On.RISE, "a.x", level))
    assert decoded(encoded(told)) == told


def test_layouts_are_saved_loaded_renamed_and_deleted(layouts: Layouts, tmp_path: Path) -> None:
    for name in ("Knees", "knees!", "Füße 左"):
        layouts.save(layout(name))
    assert layouts.names() == ["Füße 左", "Knees", "knees!"]
    assert layouts.load("knees!") == layout("knees!")
    layouts.rename("knees!", "Hips")
    with pytest.raises(LayoutError, match="there is a layout Knees already"):
        layouts.rename("Hips", "Knees")
    layouts.delete("Füße 左")
    assert layouts.names() == ["Hips", "Knees"]
    with pytest.raises(LayoutError, match="no layout knees!"):
        layouts.load("knees!")
    assert all(path.suffix == ".toml" for path in layouts.folder.iterdir()), "a draft was left behind"


def test_saving_again_replaces_it(layouts: Layouts) -> None:
    layouts.save(layout("Knees"))
    layouts.save(Layout("Knees", [PlotLayout(["c.z"])]))
    assert layouts.load("Knees").plot == [PlotLayout(["c.z"])]
    assert len(list(layouts.folder.iterdir())) == 1


def test_an_imported_one_never_replaces_one_that_is_there(layouts: Layouts, tmp_path: Path) -> None:
    file = tmp_path / "from a friend.toml"
    file.write_text(GOOD, encoding="utf-8")
    assert [layouts.take(file).name for _ in range(3)] == ["Knees", "Knees 2", "Knees 3"]
    assert layouts.load("Knees 2").plot == decoded(GOOD).plot


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("format = 1\n", "", "key format: it is to be 1"),
        ("format = 1", "format = 2", "it is 2, this version reads 1"),
        ('name = "Knees"', 'name = ""', "is no name"),
        ('name = "Knees"', "name = 3", "line 2, key name: Expected `str`, got `int`"),
        ("span_s = 5.0", "span_s = 1e9", "key span_s"),
        ("span_s = 5.0", "span_s = nan", "key span_s"),
        ("span_s = 5.0", "spam = 5.0", "unknown field `spam`"),
        ("- left_knee.target", "- ", r"line 5, key plot\[0\].curves\[1\]: .* is missing here"),
        ('["left_knee.position"]', "[]", r"line 8, key plot\[1\].curves: a plot has one"),
        ('["left_knee.position"]', "[7]", r"line 8, key plot\[1\].curves\[0\]: Expected `str`"),
        ('x = "left_hip.position"', 'x = "3 +"', r"line 8, key plot\[1\].x"),
        ('x = "left_hip.position"', "x = [", "no TOML"),
        ("[[plot]]\ncurves = [", "[plot]\ncurves = [", "no TOML|Expected `array`"),
        ('name = "Knees"', 'name = "Knees"\ntrigger = { on = "up", of = "a.x" }', "key trigger.on"),
        (
            'name = "Knees"',
            'name = "Knees"\ntrigger = { on = "comes into", of = "a.x", level = 2, high = 1 }',
            "key trigger: the window's upper end",
        ),
        (
            'name = "Knees"',
            f'name = "Knees"\ntrigger = {{ on = "rises through", of = "{"z" * 500}" }}',
            "key trigger: a curve is written in at most 400",
        ),
        (
            'name = "Knees"',
            'name = "Knees"\ntrigger = { on = "emergency (EMCY)", of = "\\u001b[2J" }',
            r"key trigger: '.*2J' is no component",
        ),
    ],
)
def test_what_is_no_layout_says_where(old: str, new: str, problem: str, tmp_path: Path) -> None:
    assert old in GOOD
    file = tmp_path / "it.toml"
    file.write_text(GOOD.replace(old, new), encoding="utf-8")
    with pytest.raises(LayoutError, match=problem) as found:
        read(file)
    assert "it.toml" in str(found.value)


def test_an_editor_may_have_marked_its_unicode(tmp_path: Path) -> None:
    (tmp_path / "it.toml").write_text(GOOD, encoding="utf-8-sig")
    assert read(tmp_path / "it.toml").name == "Knees"


def test_a_damaged_file_hides_no_other(layouts: Layouts, tmp_path: Path) -> None:
    layouts.save(layout("Knees"))
    (layouts.folder / "bad.toml").write_bytes(b"\xff\x00")
    (layouts.folder / "huge.toml").write_bytes(b"#" * 100_000)
    (layouts.folder / "deep.toml").write_text("a = " + "[" * 20_000)
    assert layouts.names() == ["Knees"]
    damaged = layouts.damaged()
    assert [name for name in ("bad", "huge", "deep") if any(f"{name}.toml" in text for text in damaged)] == [
        "bad", "huge", "deep",
    ]  # fmt: skip


@pytest.mark.parametrize("text", ["format = 1\nname = 'x'\nspan_s = {}", "format = {}"])
def test_a_number_without_end_is_no_layout_and_hides_no_other(
    layouts: Layouts, tmp_path: Path, text: str
) -> None:
    layouts.save(layout("good"))
    (layouts.folder / "bad.toml").write_text(text.format("9" * 5000))
    os.mkfifo(layouts.folder / "waits.toml")  # to open it would be to wait for ever
    assert layouts.names() == ["good"]
    assert len(layouts.damaged()) == 1


def test_a_folder_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(LayoutError, match="cannot be saved"):
        Layouts(tmp_path / "file" / "layouts").save(layout("Knees"))
    assert Layouts(tmp_path / "none").names() == []


@given(st.text(max_size=200))
@settings(max_examples=examples(100), deadline=None)
def test_no_text_does_anything_but_raise_its_error(text: str) -> None:
    for told in (text, f"format = 1\n{text}"):
        try:
            decoded(told)
        except LayoutError:
            continue
