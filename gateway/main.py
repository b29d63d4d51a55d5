"""The `gwrms` command: finds the subcommand and imports only what it needs.

Exit status: 0 done, 1 the thing failed, 2 wrong usage. Errors are a sentence or two on stderr, with `--json`
also an object on stdout; `--debug` shows the traceback.
"""

import importlib
import os
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence

from gateway import __version__

# name → (where it lives, what it does). A module here is imported only when its command runs.
COMMANDS: dict[str, tuple[str, str]] = {
    "gateway": ("gateway.cli.serve:main", "serve a robot over TCP, on demand"),
    "install-service": ("gateway.cli.install_service:main", "write systemd units for a robot's file"),
    "keys": ("gateway.cli.keys:main", "on the robot: admit and revoke clients"),
    "pair": ("gateway.cli.pair:main", "pair this desk with a robot"),
    "check": ("gateway.cli.check:main", "check a robot's or server's file, or a scenario"),
    "doctor": ("gateway.cli.doctor:main", "diagnose a robot, with evidence and fixes"),
    "describe": ("gateway.cli.describe:main", "list a robot's components and problems"),
    "snapshot": ("gateway.cli.snapshot:main", "take a snapshot of resources, components or status"),
    "cost": ("gateway.cli.cost:main", "show the cost of monitoring, client by client"),
    "bench": ("gateway.cli.bench:main", "measure a robot's gateway: latency, CPU and memory"),
    "blame": ("gateway.cli.blame:main", "name the processes that delay the control loop"),
    "watch": ("gateway.cli.watch:main", "show channels live"),
    "top": ("server_gui.cli.top:main", "monitor one robot in the terminal: tune, stop, reset"),
    "plot": ("server_gui.cli.plot:main", "plot channels, in the window or the terminal"),
    "get": ("gateway.cli.get:main", "read parameters from the devices"),
    "set": ("gateway.cli.set:main", "change parameters, all or none, read back"),
    "params": ("gateway.cli.params:main", "save, compare and apply parameter files"),
    "od": ("gateway.cli.od:main", "search, read and write a device's object dictionary"),
    "store": ("gateway.cli.store:main", "store a device's parameters in its memory"),
    "restore": ("gateway.cli.restore:main", "restore a device's defaults"),
    "journal": ("gateway.cli.journal:main", "show and verify the robot's journal"),
    "stop": ("gateway.cli.stop:main", "quick stop on every drive (not a safety-rated stop)"),
    "reset": ("gateway.cli.reset:main", "end a held stop: every drive switched off, none enabled"),
    "enable": ("gateway.cli.enable:main", "enable drives, as the master of a bench"),
    "completion": ("gateway.cli.completion:main", "complete commands in bash, zsh and fish"),
    "docs": ("gateway.cli.docs:main", "show the installed documentation"),
    "eds": ("eds.cli.eds:main", "show and check an EDS or DCF file"),
    "scan": ("drivers.cli.scan:main", "identify nodes on a CAN bus, and sensors on serial ports"),
    "lss": ("drivers.cli.lss:main", "find CANopen devices without a node id; set ids and bit rates"),
    "trace": ("drivers.cli.trace:main", "decode the frames of a CAN bus by EDS; candump and PCAP files"),
    "commission": ("gateway.cli.commission:main", "build a robot's file on the bench, joint by joint"),
    "sensor": ("drivers.cli.sensor:main", "identify, record, replay and decode a serial sensor"),
    "calibrate": ("gateway.cli.calibrate:main", "calibrate an insole's pressure, an IMU's or a joint's zero"),
    "joint-test": (
        "server_gui.cli.joint_test:main",
        "test a joint on a bench: step, chirp, friction, relay",
    ),
    "collect": ("server_gui.cli.collect:main", "record every robot into the store, without a window"),
    "sessions": (
        "server_gui.cli.sessions:main",
        "list, inspect and export recordings: CSV, Parquet, MCAP",
    ),
    "edits": ("server_gui.cli.edits:main", "show the effect of each parameter edit on the walk"),
    "ab": ("server_gui.cli.experiments:ab_main", "compare two values of a parameter during a walk"),
    "sweep": ("server_gui.cli.experiments:sweep_main", "raise a parameter in steps, while you watch"),
    "label": ("server_gui.cli.label:main", "label the activities in a recorded session"),
    "train": ("server_gui.cli.train:main", "train a model on labelled sessions, judged before it serves"),
    "cloud": ("server_gui.cli.cloud:main", "browse, upload, download, verify and tidy the store"),
    "query": ("server_gui.cli.query:main", "run SQL over all recordings"),
    "models": ("server_gui.cli.models:main", "inspect, promote, roll back and export models"),
    "predict": ("server_gui.cli.predict:main", "predict activity and gait, live or over a recording"),
    "gui": ("server_gui.cli.gui:main", "open the window: monitor robots, change parameters, STOP"),
    "evaluate": ("server_gui.cli.evaluate:main", "evaluate predictions on people never seen"),
    "demo": ("server_gui.cli.demo:demo", "start simulator, gateway and live view"),
    "sim": ("hil_sim.cli.sim:main", "simulate a robot for a gateway; run scenario files"),
    "sim-record": ("hil_sim.cli.record:main", "record simulated wearers with the truth, as training data"),
    "sim-fault": ("hil_sim.cli.fault:main", "inject faults into a running simulated robot"),
}

# The exit status of a failure where 1 is an answer: that of diff(1).
FAILED: Mapping[tuple[str, ...], int] = {("params", "compare"): 2, ("doctor",): 2}

OUR_PACKAGES = frozenset({"gateway", "drivers", "eds", "server_gui", "ml", "hil_sim"})


def usage() -> str:
    """Return the manual's first page."""
    width = max(map(len, COMMANDS))
    lines = [
        "usage: gwrms COMMAND [ARGUMENTS]",
        "",
        "GWRMS monitors and tunes a lower-limb exoskeleton: a light daemon on the robot,",
        "a live view on the desk, and a complete simulated robot for the bench.",
        "",
        "commands:",
        *(f"  {name:<{width}}  {what}" for name, (_, what) in COMMANDS.items()),
        "",
        "gwrms COMMAND --help explains a command. --debug anywhere shows tracebacks.",
        "A first look without hardware: gwrms demo",
    ]
    return "\n".join(lines) + "\n"


def find(name: str) -> Callable[[list[str]], int]:
    """Import the function behind a command; it takes its arguments and returns the exit status."""
    module_name, _, function_name = COMMANDS[name][0].partition(":")
    function: Callable[[list[str]], int] = getattr(importlib.import_module(module_name), function_name)
    return function


def explain(error: Exception, command: str) -> str:
    """Return an exception of a command as the sentences a user can act on."""
    if isinstance(error, ModuleNotFoundError) and error.name is not None:
        from gateway import missing_extras

        return missing_extras.explained(error.name, command)
    ours = type(error).__module__.partition(".")[0] in OUR_PACKAGES
    if isinstance(error, OSError) and not ours and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    if ours or isinstance(error, OSError):
        return str(error)
    return f"internal error, {type(error).__name__}: {error} (run again with --debug and report it)"


def _help_without(error: Exception, arguments: Sequence[str]) -> str | None:
    """Return the help that was asked for, of a command of which a package is missing."""
    if not isinstance(error, ModuleNotFoundError):
        return None
    from gateway import missing_extras

    return missing_extras.help_of(arguments)


def main(argv: Sequence[str] | None = None) -> int:
    """Run `gwrms` with `argv` (default: the process's own arguments) and return its exit status."""
    _replace_closed_streams()
    try:
        return _run(argv)
    except KeyboardInterrupt:
        return 130
    except ModuleNotFoundError as error:  # of those without which none is told in words of its command's
        sys.stderr.write(
            f"gwrms: {error.name} is not installed, which every command needs: pip install gwrms\n"
        )
        return 1
    except OSError as error:
        # The reader left, or the disk is full: let the interpreter's own flush at exit go nowhere.
        if not isinstance(error, BrokenPipeError):
            sys.stderr.write(f"gwrms: what it says cannot be written: {error.strerror}\n")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def _replace_closed_streams() -> None:
    """Open closed standard streams to nowhere, so that no later file takes their numbers."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: PTH123, SIM115 - for as long as we run


def _run(argv: Sequence[str] | None) -> int:
    arguments = list(sys.argv[1:] if argv is None else argv)
    debug = "--debug" in arguments
    arguments = [argument for argument in arguments if argument != "--debug"]
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        sys.stdout.write(usage())
        return 0 if arguments else 2
    name, *rest = arguments
    if name == "--version":
        sys.stdout.write(f"gwrms {__version__}\n")
        return 0
    if "--json" not in rest:
        return _command(name, rest, debug=debug)
    from gateway.cli.failures import with_error_object

    return with_error_object(lambda: _command(name, rest, debug=debug))


def _command(name: str, rest: list[str], *, debug: bool) -> int:
    if name not in COMMANDS:
        from gateway.cli.text import did_you_mean

        meant = did_you_mean(name, COMMANDS)
        sys.stderr.write(f"gwrms: there is no command {name!r}{meant or '; gwrms --help lists them'}\n")
        return 2
    try:
        return find(name)(rest)
    except BrokenPipeError:
        raise
    except Exception as error:  # noqa: BLE001 - the one place where errors become words
        if page := _help_without(error, [name, *rest]):
            sys.stdout.write(page)
            return 0
        if debug:
            traceback.print_exc()
        else:
            sys.stderr.write(f"gwrms {name}: {explain(error, name)}\n")
        if "--json" in rest:  # who reads that finds the error where the answer would be
            from gateway.cli.text import say_json

            kind = getattr(error, "kind", None) or type(error).__name__
            say_json({"error": {"kind": str(kind), "message": explain(error, name)}})
        return FAILED.get((name, *rest[:1]), FAILED.get((name,), 1))


if __name__ == "__main__":
    sys.exit(main())
