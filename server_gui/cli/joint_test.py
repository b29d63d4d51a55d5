"""`gwrms joint-test`: what a joint does on a bench; moved by the robot's computer, shown on the desk."""

from gateway.cli.text import say, warn

WORDS = ("step", "chirp", "friction", "relay", "stop")
_HELP = """\
usage: gwrms joint-test step|chirp|friction|relay ROBOT.toml:JOINT …
       gwrms joint-test stop ROBOT.toml:JOINT
       gwrms joint-test show FILE …

On the robot's computer, the first four move one joint, free on a bench, after a typed phrase, and record its
motion; stop stops it from another terminal. On the desk, show prints the results beside those of the joint's
last test. Each has its own --help.
"""


def main(argv: list[str]) -> int:
    """Run `gwrms joint-test`; what moves needs nothing of the desk."""
    word = argv[0] if argv else "--help"
    if word in WORDS:
        from gateway.cli.joint_test import main as moved

        return moved(argv)
    if word == "show":
        from server_gui.cli.joint_test_show import main as shown

        return shown(argv[1:])
    if word in ("-h", "--help"):
        say(_HELP)
        return 0 if argv else 2
    warn("joint-test", f"{word!r} is none of {', '.join((*WORDS, 'show'))}")
    return 2
