"""What a fresh install without extras must do, run by that install's own Python in an empty folder.

It imports a few models made on the spot, annotates a photo made on the spot, asks every verb for its help,
and asks for what needs an extra, which has to be refused in one sentence. scripts/check_wheel.py runs it.

    python try_install.py VERSION
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from importlib.metadata import distributions, requires, version
from importlib.util import find_spec
from pathlib import Path

# Importable names of what extras bring; none may be there.
ABSENT = (
    "torch",
    "torchvision",
    "matplotlib",
    "fastapi",
    "uvicorn",
    "scipy",
    "skimage",
    "pycocotools",
    "pyarrow",
    "ray",
    "psycopg",
    "faiss",
    "patchmatch",
    "anywidget",
    "pxr",
    "playwright",
    "transformers",
    "pytest",
)
# What the store is called that the annotations go to.
STORE = "sqlite:///annotations.db"
# A sentence on stderr: cadpose's name, then words, on one line.
SENTENCE = re.compile(r"cadpose: [^\n]+\n\Z")
# A command that needs an extra, and what its refusal has to name.
NEEDS_AN_EXTRA: tuple[tuple[str, str], ...] = (
    ("train rotation --arch lite0 --out t", "cadpose[train]"),
    ("train rotation --data labels.jsonl --out t", "cadpose[train]"),
    ("train triplet --data labels.jsonl --out t", "cadpose[train]"),
    ("train masks --out t", "cadpose[train]"),
    ("train refinement --out t", "cadpose[train]"),
    ("train export last.pt --out t.onnx", "cadpose[train]"),
    (f"review --store {STORE}", "cadpose[review]"),
    ("export usd --from out --photos . --out scenes", "cadpose[usd]"),
    (f"export parquet --store {STORE} --out t.parquet", "cadpose[parquet]"),
    ("annotate photo.png --box 60,80,260,180 --category car --parquet t.parquet", "cadpose[parquet]"),
    ("annotate photo.png --box 60,80,260,180 --category car --executor ray", "cadpose[ray]"),
    ("db init --store postgresql+psycopg://me@localhost/none", "cadpose[postgres]"),
    ("annotate photo.png --detector detectors", "cadpose[detectors]"),
    ("annotate photo.png --detector rfdetr", "cadpose[rfdetr]"),
    ("annotate photo.png --box 60,80,260,180 --category car --similarity xfeat-sm1", "cadpose[xfeat]"),
    ("annotate photo.png --box 60,80,260,180 --category car --similarity delf-sm1", "cadpose[delf]"),
    ("library search photo.png --box 60,80,260,180 --category car", "cadpose[index]"),
    ("evaluate detection labels.jsonl", "cadpose[coco]"),
    ("evaluate rotation labels.jsonl --report r", "cadpose[report]"),
    ("evaluate retrieval labels.jsonl --report r", "cadpose[report]"),
    ("experiment paper paper --renderer raster --report r", "cadpose[report]"),
    ("experiment scale scale", "cadpose[report]"),
)

# (low corner, high corner, red, green, blue) of boxes in metres; y up, the front at -z.
Boxes = Sequence[tuple[tuple[float, float, float], tuple[float, float, float], str]]
MATERIALS = {
    "paint": "0.7 0.1 0.1",
    "glass": "0.2 0.25 0.3",
    "tyre": "0.05 0.05 0.05",
    "wood": "0.5 0.35 0.2",
}
MODELS: dict[str, Boxes] = {
    "car/saloon": (
        ((-0.9, 0.3, -2.2), (0.9, 0.9, 2.2), "paint"),
        ((-0.75, 0.9, -1.0), (0.75, 1.45, 1.5), "glass"),
        ((-0.92, 0.0, -1.6), (0.92, 0.65, -0.95), "tyre"),
        ((-0.92, 0.0, 1.0), (0.92, 0.65, 1.65), "tyre"),
    ),
    "car/van": (
        ((-0.9, 0.3, -2.4), (0.9, 1.0, 2.4), "paint"),
        ((-0.85, 1.0, -1.7), (0.85, 2.0, 2.4), "paint"),
        ((-0.92, 0.0, -1.7), (0.92, 0.7, -1.0), "tyre"),
        ((-0.92, 0.0, 1.0), (0.92, 0.7, 1.7), "tyre"),
    ),
    "chair/stool": (((-0.25, 0.0, -0.25), (0.25, 0.5, 0.25), "wood"),),
}


def obj(boxes: Boxes) -> str:
    """OBJ text of coloured boxes."""
    lines, seen = ["mtllib colours.mtl"], 0
    for low, high, material in boxes:
        corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
        lines += [f"v {x} {y} {z}" for x, y, z in corners] + [f"usemtl {material}"]
        for face in ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)):
            lines.append("f " + " ".join(str(seen + corner) for corner in face))
        seen += len(corners)
    return "\n".join(lines) + "\n"


def make_models(folder: Path) -> None:
    """A folder of OBJ files with one colour file a category."""
    colours = "".join(f"newmtl {name}\nKd {value}\n" for name, value in MATERIALS.items())
    for name, boxes in MODELS.items():
        path = folder / f"{name}.obj"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(obj(boxes), encoding="ascii")
        (path.parent / "colours.mtl").write_text(colours, encoding="ascii")


def make_photo(path: Path) -> None:
    """A car from its side, drawn flat."""
    from PIL import Image, ImageDraw

    photo = Image.new("RGB", (320, 240), (170, 190, 210))
    draw = ImageDraw.Draw(photo)
    draw.rectangle((0, 160, 320, 240), fill=(110, 110, 105))
    draw.rectangle((60, 115, 260, 160), fill=(180, 25, 25))
    draw.polygon([(95, 115), (115, 82), (205, 82), (235, 115)], fill=(50, 60, 75))
    for x in (100, 215):
        draw.ellipse((x - 20, 138, x + 20, 178), fill=(15, 15, 15))
    photo.save(path)


def cadpose(*arguments: str) -> subprocess.CompletedProcess[str]:
    """The installed command."""
    command = Path(sys.executable).with_name("cadpose")
    return subprocess.run(
        [str(command), *arguments],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
        env=environment(),
    )


def environment() -> dict[str, str]:
    """Nothing of the user's: home, caches and library are in this folder."""
    here = Path.cwd()
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "CADPOSE"))}
    return {**kept, "HOME": str(here / "home"), "CADPOSE_CACHE": str(here / "cache"), "COLUMNS": "200"}


def done(*arguments: str, code: int = 0) -> subprocess.CompletedProcess[str]:
    """Run the command and insist on its exit code."""
    run = cadpose(*arguments)
    if run.returncode != code or "Traceback" in run.stderr:
        sys.exit(f"cadpose {' '.join(arguments)}: exit code {run.returncode}\n{run.stdout}{run.stderr}")
    return run


def check_help() -> int:
    """Every verb, with the verbs under it, tells its help; gives how many there are."""
    import typer
    from typer.core import TyperGroup
    from typer.testing import CliRunner

    from cadpose.cli.main import app

    def walk(command: object, path: list[str]) -> Iterator[list[str]]:
        yield path
        if isinstance(command, TyperGroup):
            for name, below in command.commands.items():
                yield from walk(below, [*path, name])

    paths = list(walk(typer.main.get_command(app), []))
    for path in paths:
        answer = CliRunner().invoke(app, [*path, "--help"])
        if answer.exit_code != 0 or "Usage: " not in answer.output:
            sys.exit(f"cadpose {' '.join(path)} --help: {answer.exit_code}\n{answer.output}")
    return len(paths)


def check_schemas() -> int:
    """The command prints the JSON Schemas that came with the package; gives how many there are."""
    import cadpose as package

    kept = sorted((Path(package.__file__).parent / "data").glob("*-schema.json"))
    listed = done("schema").stdout
    for path in kept:
        name = path.name.removesuffix("-schema.json")
        printed = done("schema", name).stdout
        if name not in listed or json.loads(printed) != json.loads(path.read_text(encoding="utf-8")):
            sys.exit(f"cadpose schema {name} prints another schema than the package holds")
    if not kept:
        sys.exit("the package holds no JSON Schema")
    return len(kept)


def check_nothing_extra() -> None:
    """No package of an extra is there, by its module's name or by its distribution's."""
    there = [name for name in ABSENT if find_spec(name) is not None]
    wanted = [
        (re.split(r"[<>=!~ \[;(]", text)[0].lower(), "extra ==" in text) for text in requires("cadpose") or ()
    ]
    extras = {name for name, extra in wanted if extra} - {name for name, extra in wanted if not extra}
    installed = {distribution.metadata["Name"].lower() for distribution in distributions()}
    there += sorted(extras & installed)
    if there:
        sys.exit(f"an install without extras brought {', '.join(there)}")


def check_annotation() -> str:
    """One photo, from OBJ files to a document that tells a pose; gives the id of its CAD model."""
    make_models(Path("models"))
    make_photo(Path("photo.png"))
    done("library", "add", "models")
    photo = ("photo.png", "--box", "60,80,260,180", "--category", "car")
    done("annotate", *photo, "--out", "out", "--store", STORE)
    (annotation,) = json.loads(Path("out/photo.json").read_text(encoding="utf-8"))["annotations"]
    if annotation["cad"]["category"] != "car" or annotation["box_iou"] < 0.5:
        sys.exit(f"the photo's car became {annotation['cad']['name']}, box IoU {annotation['box_iou']}")
    # The embedded detector reads its network whatever it finds in so plain a picture.
    done("detect", "photo.png", "--json")
    # Making a view index needs no extra, asking it does.
    done("library", "index")
    return str(annotation["cad"]["id"])


def check_refusals(cad: str) -> int:
    """What needs an extra says so in one sentence; gives how many were asked for."""
    label = {"photo": "photo.png", "box": [60, 80, 260, 180], "category": "car", "azimuth": 90, "cad": cad}
    Path("labels.jsonl").write_text(json.dumps(label) + "\n", encoding="utf-8")
    wrong = []
    for command, named in NEEDS_AN_EXTRA:
        run = cadpose(*command.split())
        if run.returncode != 1 or not SENTENCE.fullmatch(run.stderr) or named not in run.stderr:
            wrong.append(f"cadpose {command}: exit code {run.returncode}, not {named}\n{run.stderr}")
    if wrong:
        sys.exit("\n".join(wrong))
    return len(NEEDS_AN_EXTRA)


def main(expected: str) -> None:
    """All of it, in the current folder."""
    Path("home").mkdir()
    if version("cadpose") != expected or done("--version").stdout.strip() != f"cadpose {expected}":
        sys.exit(f"version {version('cadpose')} was installed, not {expected}")
    check_nothing_extra()
    asked = check_help()
    schemas = check_schemas()
    # Without a library the doctor has something to complain of.
    done("doctor", code=1)
    cad = check_annotation()
    done("doctor")
    refused = check_refusals(cad)
    print(
        f"{asked} verbs gave their help, {schemas} schemas were printed, a photo was annotated, "
        f"{refused} refusals named their extra"
    )


if __name__ == "__main__":
    main(sys.argv[1])
