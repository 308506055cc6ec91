"""`cadpose.show`: annotations in a notebook, as a model to turn by hand or as a picture."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.files import write_atomic
from cadpose.annotations.overlay import draw_overlay, overlay_cameras
from cadpose.annotations.pose_parts import pose_json, pose_of
from cadpose.annotations.scenes.gltf_meshes import single_mesh_glb
from cadpose.annotations.style import jpeg_bytes, png_bytes
from cadpose.detection.coco_writing import compressed_mask
from cadpose.errors import DependencyError, InputError
from cadpose.library.catalogue import Library
from cadpose.library.mesh import Mesh
from cadpose.photos import read_photo
from cadpose.poses import Pose4Dof
from cadpose.records import Annotation, Photo
from cadpose.rendering.raster import Rasteriser

#: Longest side of the photo that is sent to a widget; its pose is told in the photo's own pixels.
MAX_SIDE = 1600
_SCRIPT = Path(__file__).parent / "review" / "static" / "widget.js"

Shown = Annotation | Sequence[Annotation] | AnnotationDocument | Path | str


class Picture:
    """An overlay picture; a notebook shows it, `save` writes it.

    Attributes:
        image: The picture.
    """

    def __init__(self, image: Image.Image) -> None:
        self.image = image

    def _repr_png_(self) -> bytes:
        return png_bytes(self.image)

    def __repr__(self) -> str:
        return f"<cadpose picture of {self.image.width} x {self.image.height} pixels: .image, .save(path)>"

    def save(self, path: Path | str) -> None:
        """Write it as PNG or JPEG, whole or not at all.

        Raises:
            InputError: the path has another ending.
            CadposeError: the file cannot be written.
        """
        ending = Path(path).suffix.lower()
        if ending not in (".png", ".jpg", ".jpeg"):
            raise InputError(f"{path} must end in .png or .jpg")
        write_atomic(path, png_bytes(self.image) if ending == ".png" else jpeg_bytes(self.image, 92))


def show(
    annotation: Shown,
    photo: Photo | NDArray[np.uint8] | Path | str | None = None,
    library: Library | Path | str | None = None,
    *,
    interactive: bool | None = None,
) -> Any:
    """Show annotations over their photo.

    Args:
        annotation: One annotation, those of one photo, its document, or the document's file.
        photo: The photo, its file, or (H, W, 3) uint8 pixels; by default the file that the annotation names,
            which may also lie beside the document's file.
        library: The CAD library or its folder; by default ``$CADPOSE_LIBRARY`` or the user's.
        interactive: A widget with the model to turn by hand, or a picture. Unless told, a widget in a
            notebook where anywidget (the extra ``jupyter``) is installed, else a picture.

    Returns:
        A `Picture`, or an anywidget whose trait ``pose`` follows the hand and whose ``pose_4dof`` is the
        same as a `Pose4Dof`; of several annotations tabs of such widgets, one an object.

    Raises:
        InputError: nothing to show, the photo is not to be found or is another one, or a CAD model is another
            one than annotated.
        LibraryError: there is no library, or a model is not in it.
        DependencyError: a widget is asked for and anywidget or the widget's script is not there.

    Examples:
        >>> import tempfile
        >>> from pathlib import Path
        >>> import numpy as np
        >>> import trimesh
        >>> import cadpose
        >>> from cadpose.library.importers import add_path
        >>> folder = Path(tempfile.mkdtemp())
        >>> _ = trimesh.creation.box((0.4, 0.5, 1.0)).export(folder / "crate.obj")
        >>> library = cadpose.Library.create(folder / "library")
        >>> _ = add_path(library, folder / "crate.obj", category="box")
        >>> photo = np.full((120, 160, 3), 200, np.uint8)
        >>> known = cadpose.Detection(cadpose.Box(40, 30, 120, 90), "box", rotation=cadpose.Rotation(40, 20))
        >>> annotator = cadpose.Annotator(
        ...     library, masks="none", similarity="aligned", refine="off", cache=folder / "cache"
        ... )
        >>> picture = cadpose.show(annotator.annotate(photo, [known]), photo, library, interactive=False)
        >>> picture.image.size
        (960, 720)
        >>> picture.save(folder / "crate.png")
    """
    annotations, folder = _annotations(annotation)
    picture = _photo(annotations, photo, folder)
    opened = (
        library if isinstance(library, Library) else Library.open(None if library is None else Path(library))
    )
    meshes = [_mesh(opened, one) for one in annotations]
    if interactive is None:
        interactive = _in_notebook() and _missing() is None
    if not interactive:
        renderer = Rasteriser()
        views = [
            renderer.render(mesh, overlay_cameras(a)) for a, mesh in zip(annotations, meshes, strict=True)
        ]
        return Picture(draw_overlay(picture, list(zip(annotations, views, strict=True))))
    if (missing := _missing()) is not None:
        raise DependencyError(missing)
    widgets = [_widget(picture, a, mesh) for a, mesh in zip(annotations, meshes, strict=True)]
    if len(widgets) == 1:
        return widgets[0]
    import ipywidgets

    titles = [f"{i} {a.detection.category}" for i, a in enumerate(annotations, 1)]
    return ipywidgets.Tab(children=widgets, titles=titles)


def _annotations(shown: Shown) -> tuple[list[Annotation], Path | None]:
    """The annotations, and the folder of their document where it is a file."""
    folder = None
    if isinstance(shown, str | Path):
        path = Path(shown)
        shown, folder = AnnotationDocument.read(path), path.parent
    if isinstance(shown, AnnotationDocument):
        name = shown.photo.name
        annotations = shown.to_annotations()
    else:
        annotations = [shown] if isinstance(shown, Annotation) else list(shown)
        name = annotations[0].photo_name if annotations else "the list"
    if not annotations:
        raise InputError(f"there is nothing to show: {name} holds no annotation")
    first = annotations[0]
    for other in annotations[1:]:
        if (other.photo_sha256, other.photo_size) != (first.photo_sha256, first.photo_size):
            raise InputError(
                f"annotations of two photos, {first.photo_name} and {other.photo_name}: "
                "show one photo at a time"
            )
    return annotations, folder


def _photo(
    annotations: Sequence[Annotation],
    told: Photo | NDArray[np.uint8] | Path | str | None,
    folder: Path | None,
) -> Photo:
    first = annotations[0]
    name = first.photo_name
    if isinstance(told, Photo):
        photo = told
    elif isinstance(told, str | Path):
        photo = read_photo(told)
    elif told is not None:
        photo = Photo(np.asarray(told), name)
    else:
        beside = [] if folder is None else [folder / name, folder / Path(name).name]
        path = next((place for place in (Path(name), *beside) if place.is_file()), None)
        if path is None:
            raise InputError(f"the photo {name} is not to be found from here: give it as photo=...")
        photo = read_photo(path)
    other_bytes = photo.sha256 and first.photo_sha256 and photo.sha256 != first.photo_sha256
    if (photo.width, photo.height) != first.photo_size or other_bytes:
        raise InputError(
            f"{photo.name} is not the photo that was annotated as {name}: give that as photo=..."
        )
    return photo


def _mesh(library: Library, annotation: Annotation) -> Mesh:
    told, held = annotation.cad, library.get(annotation.cad.id)
    if told.sha256 and held.sha256 != told.sha256:
        raise InputError(
            f"the library's model {told.id} is not the one that was annotated in {annotation.photo_name}: "
            "give the library of that run as library=..."
        )
    return library.mesh(held)


def _in_notebook() -> bool:
    """Whether this runs in a Jupyter kernel; IPython is not imported for the question."""
    module = sys.modules.get("IPython")
    shell = module.get_ipython() if module is not None and hasattr(module, "get_ipython") else None
    return shell is not None and hasattr(shell, "kernel")


def _missing() -> str | None:
    """What keeps widgets from being made, with the mend."""
    if find_spec("anywidget") is None:
        return "an interactive view needs the package anywidget: pip install 'cadpose[jupyter]'"
    if not _SCRIPT.is_file():
        return f"the widget's script {_SCRIPT.name} was not built: run `make web`, or use interactive=False"
    return None


def _widget(photo: Photo, annotation: Annotation, mesh: Mesh) -> Any:
    mask = annotation.detection.mask
    image = Image.fromarray(np.ascontiguousarray(photo.rgb))
    image.thumbnail((MAX_SIDE, MAX_SIDE), Image.Resampling.LANCZOS)
    return _widget_class()(
        photo_png=png_bytes(image),
        photo_size=[photo.width, photo.height],
        model_glb=single_mesh_glb(mesh, annotation.cad.name or annotation.cad.id),
        pose=pose_json(annotation.pose),
        mask_rle=None if mask is None else compressed_mask(mask),
    )


@cache
def _widget_class() -> Any:
    """The widget's class, made when first wanted: anywidget is no part of the core."""
    import anywidget
    import traitlets

    class PoseWidget(anywidget.AnyWidget):
        """One photo with one model; the page's script draws it."""

        _esm = _SCRIPT
        photo_png = traitlets.Bytes(b"").tag(sync=True)
        photo_size = traitlets.List(traitlets.Int(), default_value=None, allow_none=True).tag(sync=True)
        model_glb = traitlets.Bytes(b"").tag(sync=True)
        pose = traitlets.Dict().tag(sync=True)
        display = traitlets.Enum(
            ["blend", "outline", "wireframe", "mask", "difference", "photo"], default_value="blend"
        ).tag(sync=True)
        opacity = traitlets.Float(0.62, min=0.0, max=1.0).tag(sync=True)
        mask_rle = traitlets.Dict(default_value=None, allow_none=True).tag(sync=True)

        @property
        def pose_4dof(self) -> Pose4Dof:
            """The pose as it stands now, perhaps turned by hand."""
            return pose_of(self.pose)

    return PoseWidget
