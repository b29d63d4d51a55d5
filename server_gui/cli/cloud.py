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

  ls          list tables, or with --path the files below one
  du          show the space used by tables and robots
  verify      check that every file is whole, and that every row that the spool has sent is there
  mend        repair what verify found: take missing files out, restore their rows from the spool
  upload      upload pending data of the spool now; or with --from copy a whole store
  download    download a store, or some robots or sessions of it, to a folder
  compact     merge small files
  retain      remove rows older than a number of days
  vacuum      delete files that no newer version needs
  forget      remove everything of one wearer, for good
  witnesses   print what this desk has seen of a robot's journal, as proof

URL is file:///folder or s3://bucket/prefix; without it, the store of the server's file. Keys come only from
the AWS environment or profile. gwrms cloud COMMAND --help says more.
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
