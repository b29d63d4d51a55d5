"""`gwrms gui`: the window on one robot or many."""

import argparse
from pathlib import Path

from ml.store.private import private_files
from server_gui.cli.wearer_notes import add_worn, worn
from server_gui.core.settings.server_file import add_robots, default_file, load, name_of
from server_gui.qt_needs import check, prefer_x

EPILOG = """keys
  F12, Ctrl+Space   STOP the selected robot: quick stop on every drive. It is software over a
                    network, not a safety-rated emergency stop
  Shift+F12         STOP ALL: the same for every robot of the list
  Ctrl+F            find a parameter
  Alt+O, S, R, C, L overview, signals, resources, recordings, cloud
  Alt+N             commission a robot
  Space             in a recording: play, or stand still; I and O begin and end a span

While the window is open, it records as gwrms collect does, into the same spool and store. If a collector owns
the spool already, the window only shows the data, and names the program that records.

Without --robot the robots of the server's file are shown (~/.config/gwrms/server.toml, see gwrms collect
--help); without any, the window offers a simulated one.

exit status
  0 closed; 1 the window cannot be opened here, and why; 2 usage"""


def main(argv: list[str]) -> int:
    """Run `gwrms gui`."""
    private_files()
    arguments = _parser().parse_args(argv)
    settings = add_robots(load(arguments.config), dict(arguments.robot))
    prefer_x()
    check()
    from server_gui.app import run
    from server_gui.core.desk.feeds import Record
    from server_gui.views.theme import Look

    look = None if arguments.look is None else Look(arguments.look)
    scale = None if arguments.scale is None else arguments.scale / 100
    record = None if arguments.no_record else Record(arguments.operator, arguments.notes, worn(arguments))
    return run(settings, look, scale, record=record, file=arguments.config or default_file())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms gui",
        description="Open the window: monitor robots live, change parameters safely, STOP always in sight.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "--robot",
        action="append",
        default=[],
        type=_robot,
        metavar="[NAME=]HOST:PORT",
        help="a robot's gateway; repeatable",
    )
    parser.add_argument("--config", type=Path, metavar="FILE", help="the server's file")
    parser.add_argument("--no-record", action="store_true", help="do not record")
    parser.add_argument(
        "--operator", default="", metavar="WHO", help="operator's name; kept with the sessions"
    )
    parser.add_argument("--notes", default="", metavar="TEXT", help="kept with the sessions")
    add_worn(parser)
    parser.add_argument("--look", choices=("dark", "light"), help="colours; remembered")
    parser.add_argument(
        "--scale", type=int, choices=range(80, 201), metavar="80…200", help="size of all text, %%"
    )
    return parser


def _robot(text: str) -> tuple[str, str]:
    name, equals, address = text.partition("=")
    return (name, address) if equals else (name_of(text), text)
