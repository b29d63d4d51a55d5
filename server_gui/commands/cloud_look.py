"""`gwrms cloud ls | du | verify`: what is in the store, and whether all of it is."""

from collections.abc import Iterable, Sequence

from gateway.cli.text import NONE, say, say_json, size, table
from ml.store.objects import Object
from server_gui.commands.cloud_reach import add_url, parser, progress, reach, spool, when
from server_gui.core.cloud import usage
from server_gui.core.cloud import verify as checks
from server_gui.core.cloud.usage import Usage

COLUMNS = ("FILES", "ROWS", "SIZE", "FROM (UTC)", "TO")


def ls(argv: list[str]) -> int:
    """Run `gwrms cloud ls`."""
    made = parser("cloud ls", "The store's tables, or with --path the files below one.")
    add_url(made, "url")
    made.add_argument("--path", metavar="PATH", help="as in telemetry/000/robot=exo-01")
    arguments = made.parse_args(argv)
    store = reach(arguments)
    if arguments.path is not None:
        objects = usage.below(store, arguments.path)
        return _show(arguments.json, objects, ("FILE", "SIZE", "WRITTEN (UTC)"), map(_object, objects), (1,))
    found = usage.by_table(store)
    rows = ((each.table, *_sizes(each)) for each in found)
    return _show(arguments.json, found, ("TABLE", *COLUMNS), rows, (1, 2, 3))


def du(argv: list[str]) -> int:
    """Run `gwrms cloud du`."""
    made = parser("cloud du", "Who takes how much of the store.")
    add_url(made, "url")
    arguments = made.parse_args(argv)
    store = reach(arguments)
    found = list(usage.by_robot(store))
    everything = sum(each.size_bytes for each in store.objects.listing())
    if arguments.json:
        say_json({"size_bytes": everything, "tables": found})
        return 0
    rows = [(each.table, each.robot or NONE, *_sizes(each)) for each in found]
    say(table(("TABLE", "ROBOT", *COLUMNS), rows, right=(2, 3, 4)))
    older = everything - sum(each.size_bytes for each in found)
    say(f"{size(everything)} in all; {size(older)} of that are logs, models, files of old versions\n")
    return 0


def verify(argv: list[str]) -> int:
    """Run `gwrms cloud verify`."""
    made = parser(
        "cloud verify",
        "Check every file of every table, and every batch that the spool has sent. Exit status 0: whole.",
    )
    add_url(made, "url")
    made.add_argument("--deep", action="store_true", help="read every value, not just each file's footer")
    arguments = made.parse_args(argv)
    store = reach(arguments)
    files = checks.files(store)
    with progress("files", len(files)) as advance:
        problems = list(checks.damages(store, files, advance, deep=arguments.deep))
    problems += checks.batches_missing(store, spool(arguments))
    if arguments.json:
        say_json({"files": len(files), "problems": problems})
    else:
        rows = sum(file.rows for file in files)
        whole = f"{len(files)} files with {rows} rows, {size(sum(file.size_bytes for file in files))}"
        say("".join(f"{problem}\n" for problem in problems) or f"{store.url} is whole: {whole}\n")
    return 1 if problems else 0


def _show(
    as_json: bool, found: object, header: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int]
) -> int:
    if as_json:
        say_json(found)
    else:
        say(table(header, rows, right))
    return 0


def _sizes(found: Usage) -> tuple[str, ...]:
    return str(found.files), str(found.rows), size(found.size_bytes), when(found.first), when(found.last)


def _object(found: Object) -> tuple[str, ...]:
    return found.path, size(found.size_bytes), when(found.changed)
