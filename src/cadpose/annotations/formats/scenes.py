"""glTF and USD scenes: the photo as backdrop, a camera, and the placed models; one file a photo."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Protocol

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.format import Format
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.formats.target import file_stem
from cadpose.annotations.scenes.contents import Meshes
from cadpose.annotations.scenes.gltf import read_gltf_scene, write_gltf_scene
from cadpose.annotations.scenes.layout import Placement
from cadpose.annotations.scenes.usd import read_usd_scene, write_usd_scene
from cadpose.errors import InputError
from cadpose.records import Photo


class _WriteScene(Protocol):
    def __call__(
        self,
        document: AnnotationDocument,
        library: Meshes,
        photo: Photo,
        path: Path,
        *,
        placement: Placement,
    ) -> None: ...


def _format(
    name: str, what: str, ending: str, write: _WriteScene, read: Callable[[Path], AnnotationDocument]
) -> Format:
    def write_all(documents: Iterable[AnnotationDocument], folder: Path, sources: Sources) -> None:
        # In the photo's own camera models keep their shape; else they keep the annotation's pixels.
        placement: Placement = "rigid" if sources.photo_camera else "overlay"
        for document in documents:
            photo = sources.photo(document)
            path = folder / f"{file_stem(document)}{ending}"
            write(document, sources.library, photo, path, placement=placement)

    def read_all(place: Path) -> Iterator[AnnotationDocument]:
        if not place.is_dir():
            yield read(place)
            return
        files = sorted(path for path in place.glob(f"*{ending}") if not path.name.startswith("."))
        if not files:
            raise InputError(f"the folder {place} holds no {ending} file: name another")
        yield from map(read, files)

    return Format(name, what, True, write_all, read_all)


GLTF = _format(
    "gltf",
    "binary glTF scenes: photo, camera and placed models, a .glb a photo",
    ".glb",
    write_gltf_scene,
    read_gltf_scene,
)
USD = _format(
    "usd",
    "USD scenes: photo, camera and placed models, a .usdz a photo",
    ".usdz",
    write_usd_scene,
    read_usd_scene,
)
