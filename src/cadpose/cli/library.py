"""``cadpose library``."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Annotated

import typer

from cadpose.cli.options import Categories, Json, LibraryFolder
from cadpose.cli.output import complain, print_json, print_table, progress_bar
from cadpose.cli.search import search
from cadpose.cli.view_index import index

#: What was mended in models is told this often: of a large catalogue it would be pages.
_WARNINGS = 10

app = typer.Typer(
    help="The CAD catalogue: add models, list, check, show and search them.", no_args_is_help=True
)
app.command("index")(index)
app.command("search")(search)


@app.command("add")
def add(
    source: Annotated[
        str,
        typer.Argument(
            help="A .sh3f file or a folder of them, a ShapeNetCore folder, a folder of OBJ/GLB/PLY/STL, "
            "one such file, 'sweethome3d' for the installed Debian package, or 'parametric' for models "
            "made by formula."
        ),
    ],
    category: Categories = None,
    as_category: Annotated[
        str | None, typer.Option("--as", help="Category of a folder's models that tell none.")
    ] = None,
    limit: Annotated[
        int | None, typer.Option("--limit", min=1, help="Most models a category; parametric: 10.")
    ] = None,
    table: Annotated[
        Path | None, typer.Option("--table", help="CSV: file,name,category,front,up,licence,creator.")
    ] = None,
    front: Annotated[str, typer.Option("--front", help="Front axis of a folder's models.")] = "-z",
    up: Annotated[str, typer.Option("--up", help="Up axis of a folder's models.")] = "+y",
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Processes; one a core unless told.")
    ] = None,
    library: LibraryFolder = None,
    json: Json = False,
) -> None:
    """Import models; those that are there already and have not changed are left alone."""
    from cadpose.library.catalogue import Library
    from cadpose.library.importers import add_parametric, add_path
    from cadpose.library.sweethome3d import installed_package

    path = installed_package() if source == "sweethome3d" else Path(source)
    categories, processes = tuple(category) if category else None, workers or os.cpu_count() or 1
    catalogue = Library.create(library)
    with progress_bar("import", None) as bar:

        def progress(done: int, total: int, name: str) -> None:
            bar.update(bar.tasks[0].id, completed=done, total=total)

        if source == "parametric":
            report = add_parametric(
                catalogue, categories=categories, limit=limit, workers=processes, progress=progress
            )
        else:
            report = add_path(
                catalogue,
                path,
                categories=categories,
                limit=limit,
                table=table,
                category=as_category,
                front=front,
                up=up,
                workers=processes,
                progress=progress,
            )
    for cad_id, reason in report.failed:
        complain(f"{cad_id} left out: {reason}")
    for warning in report.warnings[:_WARNINGS]:
        complain(warning)
    if len(report.warnings) > _WARNINGS:
        complain(f"{len(report.warnings) - _WARNINGS} more models were mended, --json names them all")
    if json:
        print_json(dataclasses.asdict(report))
    else:
        typer.echo(
            f"{len(report.added)} added, {len(report.updated)} updated, {len(report.unchanged)} unchanged, "
            f"{len(report.failed)} failed, {len(report.warnings)} mended: {catalogue.path}"
        )
    if report.failed and not (report.added or report.updated or report.unchanged):
        raise typer.Exit(1)


@app.command("list")
def list_models(
    category: Annotated[str | None, typer.Option("--category", help="List this category's models.")] = None,
    library: LibraryFolder = None,
    json: Json = False,
) -> None:
    """Models a category, or the models of one category."""
    from cadpose.errors import LibraryError
    from cadpose.library.catalogue import Library

    catalogue = Library.open(library)
    models = catalogue.models(category)
    if not models:
        known = ", ".join(catalogue.categories())
        raise LibraryError(f"the library has no model of category {category!r}, it has {known}")
    if json and category is None:
        print_json({"path": str(catalogue.path), "models": len(models), "categories": catalogue.categories()})
    elif json:
        print_json([dataclasses.asdict(model) for model in models])
    elif category is None:
        rows = [[name, str(count)] for name, count in catalogue.categories().items()]
        print_table(f"{len(models)} models in {catalogue.path}", ["category", "models"], rows)
    else:
        rows = [[m.name, m.id, str(m.face_count), m.licence, m.creator] for m in models]
        print_table(f"{len(models)} models", ["name", "id", "faces", "licence", "creator"], rows)


@app.command("check")
def check(library: LibraryFolder = None, json: Json = False) -> None:
    """Read every model again and name what is damaged."""
    from cadpose.library.catalogue import Library

    catalogue = Library.open(library)
    problems = catalogue.check()
    if json:
        print_json({"models": len(catalogue.models()), "problems": problems})
    else:
        for problem in problems:
            typer.echo(problem)
        typer.echo(f"{len(catalogue.models())} models, {len(problems)} problems")
    if problems:
        raise typer.Exit(1)


@app.command("symmetry")
def symmetry(
    category: Annotated[str | None, typer.Argument(help="List this category's models.")] = None,
    library: LibraryFolder = None,
    json: Json = False,
) -> None:
    """Which turns leave the models as they look: how many of each kind a category, or model by model.

    Worked out once a model, about half a second each, and kept in the library.
    """
    from cadpose.errors import LibraryError
    from cadpose.library.catalogue import Library
    from cadpose.library.symmetry import upright_counts

    catalogue = Library.open(library)
    models = catalogue.models(category)
    if not models:
        raise LibraryError(f"the library has no model of category {category!r}, see `cadpose library list`")
    groups = {}
    with progress_bar("symmetry", len(models)) as bar:
        for model in models:
            groups[model.id] = catalogue.symmetry(model)
            bar.advance(bar.tasks[0].id)
    if json:
        print_json(
            [
                {
                    "id": m.id,
                    "category": m.category,
                    "upright": groups[m.id].about().name,
                    **groups[m.id].to_json(),
                }
                for m in models
            ]
        )
    elif category is not None:
        rows = [[m.name, m.id, groups[m.id].about().name, groups[m.id].name] for m in models]
        print_table(f"{len(models)} models", ["name", "id", "about the vertical", "any axis"], rows)
    else:
        columns, counts = upright_counts([(m.category, groups[m.id]) for m in models])
        rows = [[name, *(str(n) if n else "" for n in row)] for name, row in counts.items()]
        print_table("Turns about the vertical that look alike", ["category", *columns], rows)


@app.command("show")
def show(
    category: Annotated[
        str | None, typer.Argument(help="Category; default: the most typical of each.")
    ] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="PNG to write.")] = Path("contact-sheet.png"),
    azimuth: Annotated[float, typer.Option("--azimuth", help="Degrees.")] = 30.0,
    elevation: Annotated[float, typer.Option("--elevation", min=-90, max=90, help="Degrees.")] = 15.0,
    columns: Annotated[int, typer.Option("--columns", min=1, help="Pictures a row.")] = 6,
    library: LibraryFolder = None,
) -> None:
    """Draw a contact sheet of the library or of one category."""
    from cadpose.annotations.files import write_atomic
    from cadpose.annotations.style import png_bytes
    from cadpose.errors import LibraryError
    from cadpose.library.catalogue import Library
    from cadpose.library.contact_sheet import contact_sheet
    from cadpose.rendering.portraits import portraits

    catalogue = Library.open(library)
    if category is None:
        models = [catalogue.representatives(name, 1)[0] for name in catalogue.categories()]
    else:
        models = list(catalogue.models(category))
        if not models:
            raise LibraryError(
                f"the library has no model of category {category!r}, see `cadpose library list`"
            )
    with progress_bar("draw", len(models)) as bar:
        entries = []
        for entry in portraits(catalogue, models, azimuth, elevation):
            entries.append(entry)
            bar.advance(bar.tasks[0].id)
    title = f"{category or 'one of each category'}: {len(models)} models"
    write_atomic(out, png_bytes(contact_sheet(entries, columns, title)))
    typer.echo(str(out))
