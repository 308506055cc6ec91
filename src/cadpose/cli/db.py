"""``cadpose db``."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Annotated

import typer

from cadpose.cli.options import Json
from cadpose.cli.output import complain, print_json, print_table

if TYPE_CHECKING:
    from cadpose.annotations.store import MergeReport

#: Damage and conflicts are told this often; --json names all.
_MOST = 50
#: So many models and makers are listed; --json names all.
_ROWS = 20

app = typer.Typer(
    help="The annotation database: make, migrate, check, count and merge stores.", no_args_is_help=True
)

StoreUrl = Annotated[
    str,
    typer.Option("--store", help="sqlite:///file.db or postgresql+psycopg://user@host/database."),
]


@app.command("init")
def init(store: StoreUrl, json: Json = False) -> None:
    """Make an empty store; one that is there already is left as it is."""
    from cadpose.annotations.database.tables import HEAD
    from cadpose.annotations.store import Store

    with Store(store, migrate=False) as opened:
        made, place = opened.revision_found == "", opened.place
    if json:
        print_json({"store": place, "made": made, "revision": HEAD})
    else:
        typer.echo(f"{'made' if made else 'there already'}: {place} (revision {HEAD})")


@app.command("migrate")
def migrate(store: StoreUrl, json: Json = False) -> None:
    """Bring an older store up to date; a copy of an SQLite file is kept beside it."""
    from cadpose.annotations.database.tables import HEAD
    from cadpose.annotations.store import Store

    with Store(store, create=False, migrate=True) as opened:
        found, backup, place = opened.revision_found, opened.backup, opened.place
    if json:
        told = None if backup is None else str(backup)
        print_json({"store": place, "from": found, "revision": HEAD, "backup": told})
    elif found == HEAD:
        typer.echo(f"up to date: {place} (revision {HEAD})")
    else:
        kept = "" if backup is None else f", the older one is kept as {backup}"
        typer.echo(f"migrated from {found or 'nothing'} to {HEAD}: {place}{kept}")


@app.command("check")
def check(store: StoreUrl, json: Json = False) -> None:
    """Read everything again: the file, foreign keys, digests, columns against documents, what nothing needs.

    Exit code 1: something is not as it was written.
    """
    from cadpose.annotations.store import Store

    with Store(store, create=False, migrate=False) as opened:
        problems = []
        for number, problem in enumerate(opened.check()):
            problems.append(problem)
            if not json and number < _MOST:
                typer.echo(str(problem))
        counts = opened.stats()["totals"] if not problems else {}
    if json:
        print_json({"totals": counts, "problems": [dataclasses.asdict(problem) for problem in problems]})
    elif len(problems) > _MOST:
        typer.echo(f"{len(problems) - _MOST} more problems, --json names them all")
    elif not problems:
        typer.echo(f"{counts['photos']} photos, {counts['annotations']} annotations, no problem")
    if problems:
        raise typer.Exit(1)


@app.command("stats")
def stats(store: StoreUrl, json: Json = False) -> None:
    """Counts by category, verdict, CAD model, licence, version and author; photos that failed."""
    from cadpose.annotations.store import Store

    with Store(store, create=False, migrate=False) as opened:
        counts, failures, place = opened.stats(), opened.photo_failures(), opened.place
    if json:
        told = [dataclasses.asdict(f) | {"failed_at": f.failed_at.isoformat()} for f in failures]
        print_json({"store": place, **counts, "failures": told})
        return
    for name, numbers in counts.items():
        if not numbers:
            continue
        rows = [[what, str(number)] for what, number in list(numbers.items())[:_ROWS]]
        if len(numbers) > _ROWS:
            rows.append([f"{len(numbers) - _ROWS} more", str(sum(list(numbers.values())[_ROWS:]))])
        print_table(name.replace("_", " "), ["", "number"], rows)
    if failures:
        rows = [[f.name, str(f.attempts), f.stage, f.reason] for f in failures[:_ROWS]]
        print_table("photos that failed", ["photo", "attempts", "stage", "reason"], rows)


@app.command("merge")
def merge(
    others: Annotated[list[str], typer.Argument(metavar="OTHER...", help="URLs of the stores to take over.")],
    store: StoreUrl,
    json: Json = False,
) -> None:
    """Take over everything of other stores, each whole or not at all; merging one twice changes nothing.

    People's decisions of all stores are kept. Where they differ the later one holds, and stderr tells.
    """
    from cadpose.annotations.store import Store

    reports: dict[str, MergeReport] = {}
    # All are looked at before the first one is merged, and before a missing target is made.
    for other in others:
        Store(other, create=False, migrate=False).close()
    with Store(store) as target:
        for other in others:
            with Store(other, create=False, migrate=False) as source:
                reports[source.place] = report = target.merge(source)
            for conflict in report.conflicts[:_MOST]:
                complain(conflict)
            if len(report.conflicts) > _MOST:
                complain(f"{len(report.conflicts) - _MOST} more conflicts, --json names them all")
    if json:
        print_json({place: dataclasses.asdict(report) for place, report in reports.items()})
        return
    rows = [
        [place, str(r.photos), str(r.annotations), str(r.decisions), str(len(r.conflicts))]
        for place, r in reports.items()
    ]
    print_table("merged", ["store", "photos", "annotations", "decisions", "conflicts"], rows)
