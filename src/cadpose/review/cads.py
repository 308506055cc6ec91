"""The CAD library: search, meshes, portraits, symmetries. Models are named by the digest of their mesh."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query, Response

from cadpose.annotations.scenes.gltf_meshes import single_mesh_glb
from cadpose.records import CadModel
from cadpose.review.answers import CadsAnswer, SymmetryAnswer
from cadpose.review.desk import Desk
from cadpose.review.drawing import portrait_png
from cadpose.review.photos import KEEP
from cadpose.review.refusals import not_found
from cadpose.review.shapes import DIGEST

#: Angles of portraits are rounded to this many degrees, sizes to so many pixels: fewer are drawn.
STEP_DEG, STEP_PX = 5, 16

MeshKey = Annotated[str, Path(pattern=DIGEST)]
_Angle = Annotated[float, Query(ge=-3600.0, le=3600.0, allow_inf_nan=False)]


def cad_routes(desk: Desk) -> APIRouter:
    """Routes under ``/api/cads``."""
    routes = APIRouter()

    def known(key: str) -> CadModel:
        found = desk.models.of_key(key)
        if found is None:
            raise not_found("the library has no such model")
        return found

    @routes.get("/cads")
    def cads(
        category: Annotated[str | None, Query(max_length=500)] = None,
        text: Annotated[str, Query(max_length=500)] = "",
        limit: Annotated[int, Query(ge=1, le=500)] = 60,
        after: Annotated[str | None, Query(max_length=2000)] = None,
    ) -> CadsAnswer:
        found, rest = desk.models.page(category or None, text, after or None, limit)
        return CadsAnswer(items=[desk.models.shape(cad) for cad in found], after=rest)

    @routes.get("/cads/{key}/mesh.glb")
    @desk.slow
    def mesh(key: MeshKey) -> Response:
        cad, library = known(key), desk.models.opened()
        data = desk.pictures.made(f"glb 1 {key}", lambda: single_mesh_glb(library.mesh(cad), cad.name))
        return Response(data, media_type="model/gltf-binary", headers=KEEP)

    @routes.get("/cads/{key}/thumb.png")
    @desk.slow
    def thumb(
        key: MeshKey,
        azimuth: _Angle = 30.0,
        elevation: Annotated[float, Query(ge=-90.0, le=90.0, allow_inf_nan=False)] = 15.0,
        inplane: _Angle = 0.0,
        size: Annotated[int, Query(ge=16, le=512)] = 128,
    ) -> Response:
        cad, library = known(key), desk.models.opened()
        turn, tilt, roll = (STEP_DEG * round(angle / STEP_DEG) for angle in (azimuth, elevation, inplane))
        turn, roll, side = turn % 360, roll % 360, STEP_PX * -(-size // STEP_PX)
        picture = desk.pictures.made(
            f"portrait 1 {key} {turn} {tilt} {roll} {side}",
            lambda: portrait_png(library.mesh(cad), desk.studio.renderer, turn, tilt, roll, side),
        )
        return Response(picture, media_type="image/png", headers=KEEP)

    @routes.get("/cads/{key}/symmetry")
    @desk.slow
    def symmetry(key: MeshKey, response: Response) -> SymmetryAnswer:
        name, turns, continuous = desk.models.twins(known(key))
        response.headers.update(KEEP)
        return SymmetryAnswer(name=name, R=turns, continuous=continuous)

    return routes
