"""`gwrms cloud witnesses`: what this desk has seen of a robot's journal, for `gwrms journal verify`."""

from gateway.cli.text import say, say_json, warn
from ml.store import NoSuchTable
from server_gui.cli.cloud_options import NO_SPOOL, add_url, parser, reach, spool
from server_gui.core.cloud.witnesses import witnesses as kept

EPILOG = """One JSON object a line: an entry's number and hash, signed by the robot's key. Keep them
anywhere but on the robot. exit status: 0 there are some; 1 there are none

example
  gwrms cloud witnesses exo-01 > exo-01.witnesses
  gwrms journal verify COPY/journal.jsonl --witness exo-01.witnesses"""


def witnesses(argv: list[str]) -> int:
    """Run `gwrms cloud witnesses`."""
    made = parser(
        "cloud witnesses", "Print this desk's witnesses of a robot's journal, signed by the robot.", EPILOG
    )
    made.add_argument("robot", metavar="ROBOT", help="its name in the store")
    add_url(made)
    arguments = made.parse_args(argv)
    try:
        store = reach(arguments)
    except NoSuchTable:
        store = None
    found = kept(store, NO_SPOOL if arguments.url else spool(arguments), arguments.robot)
    for head in found:
        say_json(head)
    if not found:
        say("")
        warn(
            "cloud",
            f"nothing that {arguments.robot} has signed is kept here: has it a key? (gwrms keys pair)",
        )
    return 0 if found else 1
