"""`gwrms sensor`: what is on a serial port, and raw captures of it."""

import argparse
from collections.abc import Callable, Sequence

from drivers.cli import decode, live, replay

MORE = """\
examples:
  gwrms sensor /dev/ttyUSB0                     what is there, at which baud rate, and its values live
  gwrms sensor record /dev/ttyUSB0 walk.bin     its raw bytes into a file, until Ctrl-C
  gwrms sensor replay walk.bin                  a pseudo-terminal that sends them again
  gwrms sensor decode --format witmotion walk.bin
"""


def main(arguments: Sequence[str]) -> int:
    """Run `gwrms sensor` and return its exit status."""
    words = {"record": replay.record_options, "replay": replay.replay_options, "decode": decode.options}
    if arguments and arguments[0] in words:
        word, *rest = arguments
        parser = argparse.ArgumentParser(prog=f"gwrms sensor {word}")
        run = words[word](parser)
    else:
        rest = list(arguments)
        parser = argparse.ArgumentParser(
            prog="gwrms sensor",
            usage="gwrms sensor PORT [--baud N] [--seconds N] [--json]\n"
            "       gwrms sensor record|replay|decode …  (each explains itself with --help)",
            description="Identify the sensor on a serial port, and show its values live.",
            epilog=MORE,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        run = live.options(parser)
    return run_parsed(parser, run, rest)


def run_parsed(
    parser: argparse.ArgumentParser,
    run: Callable[[argparse.Namespace], int],
    arguments: Sequence[str],
) -> int:
    """Parse, then run; wrong usage is exit status 2."""
    try:
        options = parser.parse_args(arguments)
    except SystemExit as done:
        return int(done.code or 0)
    return run(options)
