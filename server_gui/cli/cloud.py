"""`gwrms cloud`: browse the store, move it, check it."""

from collections.abc import Callable
from typing import Final

from gateway.cli.connect import choose
from ml.store.private import private_files
from server_gui.cli.cloud_contents import du, ls, verify
from server_gui.cli.cloud_forget import forget
from server_gui.cli.cloud_maintenance import compact, retain, vacuum
from server_gui.cli.cloud_mend import mend
from server_gui.cli.cloud_transfer import download, upload
from server_gui.cli.cloud_witnesses import witnesses

USAGE = """usage: gwrms cloud COMMAND [URL] [--config server.toml]

  ls          tables, or with --path the files below one
  du          space used by tables and robots
  verify      is every file there and whole, and every row that the spool has sent
  mend        what verify found: missing files taken out, their rows brought again from the spool
  upload      what waits in the spool, now; or with --from a whole store
  download    a store, or some robots or sessions of it, into a folder
  compact     put small files together
  retain      remove what is older than so many days
  vacuum      delete files that no newer version needs
  forget      everything of one wearer, for good
  witnesses   what this desk has seen of a robot's journal, to prove it by

URL is file:///folder or s3://bucket/prefix; without it, the store of the server's file. Keys come from the
AWS environment or profile alone. gwrms cloud COMMAND --help says more.
"""
COMMANDS: Final[dict[str, Callable[[list[str]], int]]] = {
    "ls": ls,
    "du": du,
    "verify": verify,
    "mend": mend,
    "upload": upload,
    "download": download,
    "compact": compact,
    "retain": retain,
    "vacuum": vacuum,
    "forget": forget,
    "witnesses": witnesses,
}


def main(argv: list[str]) -> int:
    """Run `gwrms cloud`."""
    private_files()
    return choose(argv, COMMANDS, USAGE)
