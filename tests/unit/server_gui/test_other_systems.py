"""The desk where Python has less than on Linux: it is imported, and what cannot work says so.

Windows and macOS are only played here: what they lack is taken away from our own modules.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
OTHERS = "import deltalake, duckdb, obstore, pyarrow.dataset, pyqtgraph, scipy.stats, PySide6.QtWidgets\n"
WINDOWS = """
import asyncio, builtins, multiprocessing, os, signal, socket, subprocess, sys, time
sys.platform = "win32"
LACKS = {"crypt", "fcntl", "grp", "pty", "pwd", "readline", "resource", "syslog", "termios", "tty"}
OURS = {"gwrms", "gateway", "drivers", "eds", "server_gui", "ml", "hil_sim"}
imported = builtins.__import__
def without(name, globals=None, locals=None, fromlist=(), level=0):
    if name in LACKS and (globals or {}).get("__name__", "").partition(".")[0] in OURS:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)
    return imported(name, globals, locals, fromlist, level)
builtins.__import__ = without
for module, names in {
    os: "O_CLOEXEC O_DIRECTORY O_NOFOLLOW O_NONBLOCK geteuid getuid pread posix_fallocate sched_getaffinity"
        " setpriority setxattr getxattr statvfs sysconf uname killpg getpgid WNOHANG",
    signal: "SIGHUP SIGKILL SIGUSR1 SIGUSR2 SIGCHLD SIGPIPE SIGALRM SIGQUIT pthread_kill pthread_sigmask",
    socket: "AF_UNIX AF_CAN SO_REUSEPORT SCM_RIGHTS",
    time: "CLOCK_MONOTONIC clock_gettime clock_gettime_ns",
}.items():
    for name in names.split():
        delattr(module, name)
"""


# All but the window in one process: what that imports takes seconds.
DONE = """
import contextlib, io, json, tempfile
from pathlib import Path
said = {}
def help_of(command):
    from gateway.main import main
    with contextlib.redirect_stdout(io.StringIO()) as shown, contextlib.suppress(SystemExit):
        main([command, "--help"])
    return shown.getvalue()
def window():
    import server_gui.app
    return server_gui.app.__name__
def script():
    from gwrms import Robot
    return Robot.__name__
def record():
    from server_gui.core.recording.spool_files import take
    take(Path(tempfile.mkdtemp()))
def keys():
    from server_gui.terminal.keys import Keyboard
    Keyboard()
for command in COMMANDS:
    said[command] = help_of(command)
for action in ACTIONS:
    try:
        said[action.__name__] = action()
    except Exception as error:
        from gateway.main import explain
        said[action.__name__] = f"{type(error).__name__}: {explain(error, 'top')}"
print(json.dumps(said), flush=True)
os._exit(0)
"""
COMMANDS = ("gui", "collect", "top", "demo", "watch", "describe", "stop", "query")


@pytest.fixture(scope="module")
def said() -> dict[str, str]:
    """What came of each thing that is tried, but for the window."""
    return told(
        WINDOWS, DONE.replace("COMMANDS", repr(COMMANDS)).replace("ACTIONS", "(script, record, keys)")
    )


def told(*script: str) -> dict[str, str]:
    """What came of it."""
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(script)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, str] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("command", COMMANDS)
def test_help_is_there(command: str, said: dict[str, str]) -> None:
    assert said[command].startswith(f"usage: gwrms {command}")


def test_the_window_is_imported() -> None:
    done = DONE.replace("COMMANDS", "()").replace("ACTIONS", "(window,)")
    assert told(OTHERS, WINDOWS, done)["window"] == "server_gui.app"


def test_a_script_reaches_robots_from_there(said: dict[str, str]) -> None:
    assert said["script"] == "Robot"


def test_what_cannot_be_recorded_there_says_why(said: dict[str, str]) -> None:
    assert said["record"].startswith("SpoolUnusable: files cannot be locked on win32, so nothing can be kept")


def test_a_terminal_that_gives_no_keys_says_why(said: dict[str, str]) -> None:
    assert said["keys"].endswith(": this does not run on win32, where Python has no 'termios': use Linux")
