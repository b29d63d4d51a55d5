"""What cannot work is refused before Qt is loaded, with what to do."""

import pytest

from server_gui import qt_needs
from server_gui.cli.gui import main
from server_gui.core.settings.server_file import SettingsError
from server_gui.qt_needs import NoWindow


def test_the_qt_that_aborts_on_this_python_is_refused_with_the_reason() -> None:
    with pytest.raises(
        NoWindow, match=r"6\.12\.0 on Python 3\.11 .*aborts.*pip install 'PySide6-Essentials==6\.11\.3'"
    ):
        qt_needs.check_version("6.12.0", (3, 11))


@pytest.mark.parametrize(
    ("version", "python"), [("6.12.0", (3, 12)), ("6.11.3", (3, 11)), ("6.12.1", (3, 11))]
)
def test_every_other_pair_is_taken(version: str, python: tuple[int, int]) -> None:
    qt_needs.check_version(version, python)


def test_missing_libraries_are_named_in_one_line_to_paste() -> None:
    with pytest.raises(NoWindow, match=r"sudo apt-get install .* libegl1 libxcb-cursor0$"):
        qt_needs.check_libraries(
            qt_needs.ALWAYS | qt_needs.WINDOW,
            lambda library: library not in ("libEGL.so.1", "libxcb-cursor.so.0"),
        )


def test_without_a_display_other_ways_are_named() -> None:
    with pytest.raises(NoWindow, match=r"there is no display here.*gwrms watch"):
        qt_needs.check_display({}, "")
    qt_needs.check_display({"DISPLAY": ":0"}, "")
    qt_needs.check_display({}, "offscreen")


@pytest.mark.parametrize(
    ("environment", "platform"),
    [
        ({"WAYLAND_DISPLAY": "wayland-0", "DISPLAY": ":0"}, "xcb;wayland"),
        ({"WAYLAND_DISPLAY": "wayland-0"}, None),
        ({"DISPLAY": ":0"}, None),
        ({"WAYLAND_DISPLAY": "wayland-0", "DISPLAY": ":0", "QT_QPA_PLATFORM": "wayland"}, "wayland"),
    ],
)
def test_on_wayland_its_x_server_is_taken_unless_somebody_says_otherwise(
    environment: dict[str, str], platform: str | None
) -> None:
    qt_needs.prefer_x(environment)
    assert environment.get("QT_QPA_PLATFORM") == platform


def test_whether_the_window_can_be_opened_is_asked_of_where_it_would_be() -> None:
    environment = {"WAYLAND_DISPLAY": "wayland-0", "DISPLAY": ":0"}
    qt_needs.can_open(environment)
    assert environment["QT_QPA_PLATFORM"] == "xcb;wayland"
    assert not qt_needs.can_open({})


def test_a_wrong_address_is_refused_before_anything_is_opened() -> None:
    with pytest.raises(SettingsError, match="is not a robot's address"):
        main(["--robot", "exo-01=host:port"])


@pytest.mark.parametrize("scale", ["79", "201", "big"])
def test_a_size_out_of_range_is_wrong_usage(scale: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["--scale", scale])
    assert "--scale" in capsys.readouterr().err
