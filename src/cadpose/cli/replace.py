"""``cadpose replace``."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from cadpose.cli.options import Device, Json, LibraryFolder, Seed
from cadpose.cli.output import print_json

if TYPE_CHECKING:
    from cadpose.library.catalogue import Library
    from cadpose.records import Annotation, Photo


def _library_category(name: str | None) -> str | None:
    from cadpose.library.class_map import category_or_word

    return name and category_or_word(name)


def replace(
    path: Annotated[Path, typer.Argument(metavar="PHOTO", help="The photograph.")],
    cad: Annotated[
        str, typer.Option("--with", help="The CAD model that is to stand there: its id, or its name.")
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="The picture, a PNG; runs/replace/PHOTO.png unless told."),
    ] = None,
    scene: Annotated[
        Path | None, typer.Option("--scene", help="Also write the scene to this glTF file (.glb).")
    ] = None,
    background: Annotated[
        Path | None, typer.Option("--background", help="Also write the photo without the object, a PNG.")
    ] = None,
    category: Annotated[
        str | None,
        typer.Option("--category", callback=_library_category, help="Replace an object of this category."),
    ] = None,
    number: Annotated[
        int | None,
        typer.Option("--object", min=1, help="Replace the object of this number; the largest unless told."),
    ] = None,
    annotation: Annotated[
        Path | None,
        typer.Option(
            "--annotation", help="Document of `cadpose annotate`; without it the photo is annotated."
        ),
    ] = None,
    size: Annotated[
        Literal["match", "real"],
        typer.Option(
            "--size", help="As large in the picture as the old model, or as both models' centimetres say."
        ),
    ] = "match",
    shadow: Annotated[
        bool, typer.Option("--shadow/--no-shadow", help="Draw its shadow on the ground.")
    ] = True,
    light: Annotated[bool, typer.Option("--light/--no-light", help="Guess the light from the photo.")] = True,
    library: LibraryFolder = None,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Put another CAD model in the place of an object of a photo."""
    from cadpose.annotations.files import spare_photos, write_atomic
    from cadpose.annotations.pose_parts import pose_json
    from cadpose.annotations.style import png_bytes
    from cadpose.library.catalogue import Library
    from cadpose.photos import read_photo
    from cadpose.replacement.choosing import chosen_object, model_named
    from cadpose.replacement.outputs import output_files, picture_png
    from cadpose.replacement.replacer import Replacer
    from cadpose.replacement.sheet import before_and_after

    files = output_files(path, out, scene, background)
    spare_photos(files.all, [path, *([] if annotation is None else [annotation])])
    opened = Library.open(library)
    model = model_named(opened, cad)
    photo = read_photo(path)
    annotations = _annotations(photo, annotation, opened, category, device, seed)
    chosen = chosen_object(annotations, photo.name, number, category)
    replaced = Replacer(opened, seed=seed).replace(
        photo, chosen, model, shadow=shadow, light=light, size=size, others=annotations
    )
    if files.scene is not None:
        write_atomic(files.scene, replaced.scene_glb(), "--scene")
    if files.background is not None:
        write_atomic(files.background, picture_png(replaced.background), "--background")
    write_atomic(files.sheet, png_bytes(before_and_after(photo, replaced)))
    write_atomic(files.picture, picture_png(replaced.picture))
    if json:
        print_json(
            {
                "photo": photo.name,
                "category": chosen.detection.category,
                "cad": {
                    "id": model.id,
                    "name": model.name,
                    "licence": model.licence,
                    "creator": model.creator,
                },
                "pose": pose_json(replaced.pose),
                "light": asdict(replaced.light),
                "inpainter": replaced.inpainter,
                "seconds": {stage: round(told, 3) for stage, told in replaced.seconds.items()},
                "files": {kind: str(file) for kind, file in files.by_kind.items()},
            }
        )
    else:
        typer.echo(
            f"{chosen.detection.category} of {photo.name} replaced by {model.name or model.id}: "
            f"{files.picture}, before and after: {files.sheet}"
        )


def _annotations(
    photo: Photo, document: Path | None, library: Library, category: str | None, device: str, seed: int
) -> list[Annotation]:
    if document is not None:
        from cadpose.replacement.outputs import annotations_of

        return annotations_of(document, photo)
    from cadpose.pipeline import Annotator

    annotator = Annotator(
        library.path, device=device, seed=seed, categories=None if category is None else [category]
    )
    return annotator.annotate(photo)
