"""A photo's scene as one USD package (.usdz), and the annotations read back from one.

Needs the extra ``usd`` (usd-core). The package holds ``scene.usdc`` and its pictures under ``textures/``.
"""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.files import write_atomic
from cadpose.annotations.scenes.contents import Meshes, SceneContents, gather
from cadpose.annotations.scenes.extras import GENERATOR, KEY, credits, model_extras, unit_told
from cadpose.annotations.scenes.layout import PlacedModel, Placement, turns_and_scales
from cadpose.annotations.scenes.pieces import Piece
from cadpose.annotations.scenes.shades import lamps, linear_from_srgb
from cadpose.errors import CadposeError, DependencyError, InputError
from cadpose.geometry.frames import FloatArray
from cadpose.library.textures import encode_texture
from cadpose.records import Photo
from cadpose.rendering.scene import MaterialKind

#: Width of the camera's film in metres; only its ratio to the focal length shows in a picture.
_FILM = 0.036
_LAYER = "scene.usdc"


def write_usd_scene(
    document: AnnotationDocument,
    library: Meshes,
    photo: Photo,
    path: str | os.PathLike[str],
    *,
    placement: Placement = "overlay",
) -> None:
    """Write the scene of one photo, whole or not at all.

    Args:
        document: The photo's annotations.
        library: The library that their CAD models are in.
        photo: The photo itself.
        path: Of the .usdz file; its folder is made.
        placement: ``"overlay"``: models on the annotation's pixels; ``"rigid"``: models undistorted.

    Raises:
        DependencyError: usd-core is not there.
        InputError: the photo is not the document's, or an annotation cannot be placed.
        LibraryError: a model is not in the library, or its file is damaged.
        CadposeError: the file cannot be written.
    """
    _require_usd()
    from pxr import Tf

    contents = gather(document, library, photo, placement, centred=False)
    try:
        with tempfile.TemporaryDirectory(prefix="cadpose-usd-") as folder:
            packed = _Writer(contents, Path(folder)).package().read_bytes()
    except (OSError, Tf.ErrorException) as error:
        reason = getattr(error, "strerror", None) or str(error).strip().splitlines()[-1]
        raise CadposeError(f"cannot put {path} together in {tempfile.gettempdir()}: {reason}") from None
    write_atomic(path, packed)


def read_usd_scene(path: str | os.PathLike[str]) -> AnnotationDocument:
    """The annotations that a .usdz of `write_usd_scene` carries.

    Raises:
        DependencyError: usd-core is not there.
        InputError: it is no such file, or the document in it is not valid.
    """
    _require_usd()
    from pxr import Sdf, Tf

    if not Path(path).is_file():
        raise InputError(f"{path} cannot be read: there is no such file")
    try:
        layer = Sdf.Layer.FindOrOpen(os.fspath(path))
        text = layer.customLayerData[KEY]["document"]
    except (Tf.ErrorException, AttributeError, KeyError, TypeError):
        raise InputError(f"{path} is no scene that cadpose exported: it carries no annotations") from None
    return AnnotationDocument.from_json(str(text), str(path))


def _require_usd() -> None:
    try:
        import pxr  # noqa: F401
    except ImportError as error:
        raise DependencyError("USD scenes need the package usd-core: pip install 'cadpose[usd]'") from error


@dataclass
class _Writer:
    contents: SceneContents
    folder: Path
    _files: list[str] = field(default_factory=list)
    _textures: dict[int, str] = field(default_factory=dict)
    _looks: dict[str, list[Any]] = field(default_factory=dict)

    def package(self) -> Path:
        """Write everything below the folder and pack it; the package's path."""
        from pxr import Sdf, Usd, UsdGeom

        document, layout = self.contents.document, self.contents.layout
        stage = self.stage = Usd.Stage.CreateNew(str(self.folder / _LAYER))
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        root = UsdGeom.Xform.Define(stage, "/Scene").GetPrim()
        stage.SetDefaultPrim(root)
        Usd.ModelAPI(root).SetKind("group")
        layer = stage.GetRootLayer()
        layer.comment = f"{GENERATOR}. {credits(document)}"
        told = {"document": document.model_dump_json(by_alias=True), "unit": unit_told(layout.models)}
        layer.customLayerData = {KEY: {**told, "credits": credits(document), "generator": GENERATOR}}
        UsdGeom.Scope.Define(stage, "/Scene/Looks")
        self._camera()
        self._backdrop()
        self._lights()
        for model in layout.models:
            self._model(model)
        layer.Save()
        packed = self.folder / "scene.usdz"
        writer = Sdf.ZipFileWriter.CreateNew(str(packed))
        # The first file of a package is the one that is opened.
        for name in (_LAYER, *self._files):
            writer.AddFile(str(self.folder / name), name)
        writer.Save()
        return packed

    def _camera(self) -> None:
        from pxr import Gf, UsdGeom

        told = self.contents.layout.camera
        camera = UsdGeom.Camera.Define(self.stage, "/Scene/PhotoCamera")
        # Lengths on the film are in tenths of the scene's unit.
        tenths = 10.0 * _FILM / told.width
        camera.CreateHorizontalApertureAttr(tenths * told.width)
        camera.CreateVerticalApertureAttr(tenths * told.height)
        x, y = told.principal_px
        camera.CreateHorizontalApertureOffsetAttr(tenths * (told.width / 2.0 - x))
        camera.CreateVerticalApertureOffsetAttr(tenths * (y - told.height / 2.0))
        camera.CreateFocalLengthAttr(tenths * told.focal_px)
        camera.CreateClippingRangeAttr(Gf.Vec2f(told.near, told.far))
        camera.GetPrim().SetCustomData(
            {KEY: {"focal_px": told.focal_px, "photo_size": Gf.Vec2i(told.width, told.height)}}
        )

    def _backdrop(self) -> None:
        from pxr import Sdf

        picture = self._file(self.contents.photo_jpeg)
        material = self._material("/Scene/Looks/Photo")
        surface = material[1]
        # It gives off its picture and reflects nothing.
        surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set((0, 0, 0))
        surface.CreateInput("useSpecularWorkflow", Sdf.ValueTypeNames.Int).Set(1)
        surface.CreateInput("specularColor", Sdf.ValueTypeNames.Color3f).Set((0, 0, 0))
        surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0)
        texture = self._read_texture(material[0], picture, "clamp", (1.0, 1.0, 1.0, 1.0))
        emission = surface.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f)
        emission.ConnectToSource(texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))
        corners = self.contents.layout.backdrop
        uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
        faces = np.array([(0, 1, 2), (0, 2, 3)])
        normals = np.tile(np.array([(0, 0, 1)], np.float32), (4, 1))
        self._mesh("/Scene/Photo", corners, faces, normals, uv, material[0])

    def _lights(self) -> None:
        from pxr import UsdGeom, UsdLux

        UsdGeom.Scope.Define(self.stage, "/Scene/Lights")
        for lamp in lamps():
            name = "".join(word.capitalize() for word in lamp.name.split())
            light = UsdLux.DistantLight.Define(self.stage, f"/Scene/Lights/{name}")
            # Normalised, a surface that faces the lamp gets its intensity whatever angle it fills.
            light.CreateNormalizeAttr(True)
            light.CreateIntensityAttr(lamp.strength)
            UsdGeom.Xformable(light).AddTransformOp().Set(_matrix(lamp.turn()))

    def _model(self, model: PlacedModel) -> None:
        from pxr import Usd, UsdGeom

        cad_id = model.annotation.cad.id
        path = f"/Scene/Object_{model.number + 1}"
        body = UsdGeom.Xform.Define(self.stage, path)
        outer, scales, inner = turns_and_scales(model.T_scene_from_s)
        # One matrix could lean the model too, but programs that split it into turn and scale lose that.
        body.AddTransformOp().Set(_matrix(outer * scales, model.T_scene_from_s[:3, 3]))
        UsdGeom.Xform.Define(self.stage, f"{path}/Model").AddTransformOp().Set(_matrix(inner))
        Usd.ModelAPI(body.GetPrim()).SetKind("component")
        body.GetPrim().SetDisplayName(model.annotation.cad.name or cad_id)
        body.GetPrim().SetCustomData({KEY: _usd_values(model_extras(model))})
        if cad_id not in self._looks:
            first = sum(map(len, self._looks.values()))
            pieces = self.contents.pieces[cad_id]
            self._looks[cad_id] = [self._look(piece, first + i) for i, piece in enumerate(pieces)]
        for i, piece in enumerate(self.contents.pieces[cad_id]):
            name = f"{path}/Model/Piece_{i + 1}"
            look = self._looks[cad_id][i]
            self._mesh(name, piece.vertices, piece.faces, piece.normals, piece.uv, look)

    def _mesh(self, path: str, vertices: Any, faces: Any, normals: Any, uv: Any, material: Any) -> None:
        from pxr import Sdf, UsdGeom, UsdShade, Vt

        mesh = UsdGeom.Mesh.Define(self.stage, path)
        points = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(vertices, np.float32))
        mesh.CreatePointsAttr(points)
        mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
        indices = np.ascontiguousarray(faces, np.int32)
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(indices), 3))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(indices.ravel()))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateDoubleSidedAttr(True)
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(normals, np.float32)))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        if uv is not None:
            api = UsdGeom.PrimvarsAPI(mesh)
            st = api.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
            st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(uv, np.float32)))
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)

    def _material(self, path: str) -> tuple[Any, Any]:
        from pxr import Sdf, UsdShade

        material = UsdShade.Material.Define(self.stage, path)
        surface = UsdShade.Shader.Define(self.stage, f"{path}/Surface")
        surface.CreateIdAttr("UsdPreviewSurface")
        output = surface.CreateOutput("surface", Sdf.ValueTypeNames.Token)
        material.CreateSurfaceOutput().ConnectToSource(output)
        return material, surface

    def _look(self, piece: Piece, number: int) -> Any:
        from pxr import Gf, Sdf

        material, surface = self._material(f"/Scene/Looks/Look_{number + 1}")
        material.GetPrim().SetDisplayName(piece.material.name or f"look {number + 1}")
        red, green, blue = linear_from_srgb(piece.material.rgba[:3])
        alpha = piece.material.rgba[3]
        surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.8)
        surface.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
        colour = surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
        opacity = surface.CreateInput("opacity", Sdf.ValueTypeNames.Float)
        if piece.kind is MaterialKind.CUTOUT:
            surface.CreateInput("opacityThreshold", Sdf.ValueTypeNames.Float).Set(0.5)
        if piece.material.texture is None:
            colour.Set(Gf.Vec3f(red, green, blue))
            opacity.Set(alpha)
            return material
        key = id(piece.material.texture)
        if key not in self._textures:
            self._textures[key] = self._file(encode_texture(piece.material.texture))
        texture = self._read_texture(material, self._textures[key], "repeat", (red, green, blue, alpha))
        colour.ConnectToSource(texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3))
        if piece.kind is MaterialKind.OPAQUE:
            opacity.Set(1.0)
        else:
            opacity.ConnectToSource(texture.CreateOutput("a", Sdf.ValueTypeNames.Float))
        return material

    def _read_texture(
        self, material: Any, file: str, wrap: str, scale: tuple[float, float, float, float]
    ) -> Any:
        from pxr import Gf, Sdf, UsdShade

        path = material.GetPath()
        reader = UsdShade.Shader.Define(self.stage, path.AppendChild("Coordinates"))
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        texture = UsdShade.Shader.Define(self.stage, path.AppendChild("Texture"))
        texture.CreateIdAttr("UsdUVTexture")
        texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"./{file}")
        coordinates = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(coordinates)
        texture.CreateInput("wrapS", Sdf.ValueTypeNames.Token).Set(wrap)
        texture.CreateInput("wrapT", Sdf.ValueTypeNames.Token).Set(wrap)
        texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
        texture.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*scale))
        return texture

    def _file(self, data: bytes) -> str:
        """Keep a picture for the package; its name in it."""
        ending = "png" if data.startswith(b"\x89PNG") else "jpg"
        name = f"textures/{len(self._files)}.{ending}"
        (self.folder / "textures").mkdir(exist_ok=True)
        (self.folder / name).write_bytes(data)
        self._files.append(name)
        return name


def _matrix(linear: FloatArray, translation: FloatArray | None = None) -> Any:
    """USD multiplies row vectors: its matrix is the transpose."""
    from pxr import Gf

    T = np.eye(4)
    T[:3, :3] = linear
    T[:3, 3] = 0.0 if translation is None else translation
    return Gf.Matrix4d(*T.T.ravel().tolist())


def _usd_values(told: dict[str, Any]) -> dict[str, Any]:
    """JSON's types as USD's dictionaries carry them; what is null is left out."""
    from pxr import Vt

    values: dict[str, Any] = {}
    for name, value in told.items():
        if isinstance(value, dict):
            values[name] = _usd_values(value)
        elif isinstance(value, list):
            values[name] = Vt.DoubleArray(value)
        elif value is not None:
            values[name] = value
    return values
