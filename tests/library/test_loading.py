from __future__ import annotations

import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cadpose.errors import InputError
from cadpose.library import loading as loading_module
from cadpose.library.limits import DEFAULT_LIMITS
from cadpose.library.loading import load_mesh, load_mesh_file
from cadpose.library.mesh import Mesh

from .builders import (
    CUBE,
    CUBE_FACES,
    CUBE_VERTICES,
    SQUARE,
    NoAssets,
    bomb_png,
    glb,
    png,
    triangle_gltf,
    write,
)


def load_square(folder: Path, mtl: str, told: list[str] | None = None) -> Mesh:
    write(folder, square__obj=SQUARE, square__mtl=mtl)
    return load_mesh_file(folder / "square.obj", warn=(told if told is not None else []).append)


def test_quads_become_triangles_with_flat_sides(tmp_path: Path) -> None:
    mesh = load_mesh_file(write(tmp_path, cube__obj=CUBE) / "cube.obj")
    assert mesh.faces.shape == (12, 3)
    assert mesh.vertices.shape == (8, 3)
    # Ninety degrees is beyond the crease angle: every corner has its face's own axis-parallel normal.
    assert np.allclose(np.sort(np.abs(mesh.corner_normals), axis=2), [0, 0, 1], atol=1e-6)


def test_a_sphere_without_normals_is_smooth(tmp_path: Path) -> None:
    rows, columns = 24, 48
    lines, faces = [], []
    for r in range(rows + 1):
        for c in range(columns):
            t, p = np.pi * r / rows, 2 * np.pi * c / columns
            lines.append(f"v {np.sin(t) * np.cos(p)} {np.cos(t)} {np.sin(t) * np.sin(p)}")
    for r in range(rows):
        for c in range(columns):
            a, b = r * columns + c + 1, r * columns + (c + 1) % columns + 1
            faces.append(f"f {a} {b} {b + columns} {a + columns}")
    mesh = load_mesh_file(write(tmp_path, s__obj="\n".join(lines + faces)) / "s.obj")
    corners = mesh.vertices[mesh.faces]
    cosine = np.abs(np.einsum("fij,fij->fi", mesh.corner_normals, corners))
    assert cosine.min() > np.cos(np.radians(4))


def test_given_normals_are_kept_and_useless_ones_replaced() -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvn 0.6 0 0.8\nvn 0 0 0\nf 1//1 2//1 3//1\nf 2//2 4//2 3//2\n"
    mesh = load_mesh(text.encode(), "t.obj", NoAssets())
    found = {tuple(np.round(n, 3)) for n in np.abs(mesh.corner_normals.reshape(-1, 3))}
    assert found == {(np.float32(0.6), np.float32(0), np.float32(0.8)), (0, 0, 1)}


def test_relative_indices_count_from_where_they_stand() -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 5\nv 1 0 5\nv 0 1 5\nf -3 -2 -1\n"
    mesh = load_mesh(text.encode(), "t.obj", NoAssets())
    assert sorted(mesh.vertices[mesh.faces][:, 0, 2].tolist()) == [-2.5, 2.5]


def test_map_coordinates_keep_the_shape() -> None:
    points = [(x, y, z) for x in (0, 1.3) for y in (0, 1) for z in (0, 2.2)]
    near, far = (
        load_mesh(
            ("".join(f"v {x + east} {y} {z + north}\n" for x, y, z in points) + CUBE_FACES).encode(),
            "house.obj",
            NoAssets(),
        )
        for east, north in ((0, 0), (500_000, 5_400_000))
    )
    assert np.array_equal(near.faces, far.faces)
    assert np.allclose(near.vertices, far.vertices, atol=1e-6)


def test_degenerate_faces_are_dropped() -> None:
    mesh = load_mesh((CUBE + "f 1 1 2\nf 1 2 1\n").encode(), "c.obj", NoAssets())
    assert len(mesh.faces) == 12


def test_texture_coordinates_and_colour(tmp_path: Path) -> None:
    write(tmp_path, wood__png=png((200, 40, 10)))
    mesh = load_square(tmp_path, "newmtl paint\nKd 0.1 0.1 0.1\nmap_Kd -s 1 1 1 wood.png\n")
    (material,) = mesh.materials
    assert material.rgba == (1.0, 1.0, 1.0, 1.0)
    assert material.texture is not None
    assert material.texture[0, 0].tolist() == [200, 40, 10]
    corner = mesh.vertices[mesh.faces]
    assert np.allclose(corner[..., :2] + 0.5, mesh.corner_uv)


@pytest.mark.parametrize(
    ("statements", "alpha"),
    [
        ("d 0.4", 0.4),
        ("Tr 0.25", 0.75),
        ("d 1\nTr 1", 1.0),
        ("Tr 1\nd 1", 1.0),
        ("", 1.0),
        ("d -halo 0.5", 0.5),
    ],
)
def test_see_through(tmp_path: Path, statements: str, alpha: float) -> None:
    mesh = load_square(tmp_path, f"newmtl paint\nKd 0.2 0.4 0.6\n{statements}\n")
    assert mesh.materials[0].rgba == pytest.approx((0.2, 0.4, 0.6, alpha))


def test_wholly_transparent_models_are_drawn_opaque_and_panes_faintly(tmp_path: Path) -> None:
    told: list[str] = []
    assert load_square(tmp_path, "newmtl paint\nd 0\n", told).materials[0].rgba[3] == 1.0
    assert len(told) == 1
    two = SQUARE + "usemtl pane\nf 2/2 3/3 4/4\n"
    write(tmp_path, two__obj=two, square__mtl="newmtl paint\nd 1\nnewmtl pane\nd 0\n")
    alphas = sorted(m.rgba[3] for m in load_mesh_file(tmp_path / "two.obj").materials)
    assert alphas == [0.2, 1.0]


def test_missing_texture_falls_back_to_the_colour(tmp_path: Path) -> None:
    told: list[str] = []
    mesh = load_square(tmp_path, "newmtl paint\nKd 0.3 0.2 0.1\nmap_Kd gone.png\n", told)
    assert mesh.materials[0].rgba[:3] == pytest.approx((0.3, 0.2, 0.1))
    assert len(told) == 1
    assert "gone.png" in told[0]


@pytest.mark.parametrize("content", [b"", b"no image", png()[:40]])
def test_damaged_texture_falls_back_to_the_colour(tmp_path: Path, content: bytes) -> None:
    told: list[str] = []
    write(tmp_path, wood__png=content)
    mesh = load_square(tmp_path, "newmtl paint\nKd 0.3 0.2 0.1\nmap_Kd wood.png\n", told)
    assert mesh.materials[0].texture is None
    assert "wood.png" in told[0]


def test_a_decompression_bomb_is_not_decoded(tmp_path: Path) -> None:
    told: list[str] = []
    write(tmp_path, wood__png=bomb_png())
    assert load_square(tmp_path, "newmtl paint\nmap_Kd wood.png\n", told).materials[0].texture is None
    assert "pixels" in told[0]


def test_texture_without_coordinates_gives_its_mean_colour(tmp_path: Path) -> None:
    told: list[str] = []
    write(tmp_path, wood__png=png((255, 0, 51)), plain__obj="mtllib plain.mtl\nusemtl paint\n" + CUBE)
    write(tmp_path, plain__mtl="newmtl paint\nmap_Kd wood.png\n")
    mesh = load_mesh_file(tmp_path / "plain.obj", warn=told.append)
    assert mesh.materials[0].texture is None
    assert mesh.materials[0].rgba == pytest.approx((1.0, 0.0, 0.2, 1.0))
    assert "no coordinates" in told[0]


def test_faces_with_and_without_coordinates_may_share_a_material(tmp_path: Path) -> None:
    write(tmp_path, wood__png=png((255, 0, 51)), mixed__obj=SQUARE + "v 0 0 1\nf 1 2 5\nf 1/1 3/3 5/4\n")
    write(tmp_path, square__mtl="newmtl paint\nmap_Kd wood.png\n")
    mesh = load_mesh_file(tmp_path / "mixed.obj")
    textured = [mesh.materials[m].texture is not None for m in mesh.face_material]
    assert sorted(textured) == [False, True, True, True]
    plain = mesh.materials[mesh.face_material[textured.index(False)]]
    assert plain.rgba == pytest.approx((1.0, 0.0, 0.2, 1.0))


def test_large_textures_are_reduced(tmp_path: Path) -> None:
    write(tmp_path, wood__png=png((1, 2, 3), (3000, 1500)))
    texture = load_square(tmp_path, "newmtl paint\nmap_Kd wood.png\n").materials[0].texture
    assert texture is not None
    assert texture.shape == (512, 1024, 3)


def test_separate_opacity_map(tmp_path: Path) -> None:
    write(tmp_path, leaf__png=png((10, 200, 10)), hole__png=png((51, 51, 51)))
    texture = load_square(tmp_path, "newmtl paint\nmap_Kd leaf.png\nmap_d hole.png\n").materials[0].texture
    assert texture is not None
    assert texture[0, 0].tolist() == [10, 200, 10, 51]


def many_materials(count: int) -> str:
    uses = "".join(f"usemtl m{i}\nf 1/1 2/2 {4 + i}/3\n" for i in range(count))
    points = "".join(f"v 0 1 {i}\n" for i in range(count))
    return f"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n{points}{uses}"


def test_materials_share_a_texture_made_of_two_images(tmp_path: Path) -> None:
    mtl = "".join(f"newmtl m{i}\nd 0.{i + 3}\nmap_Kd leaf.png\nmap_d hole.png\n" for i in range(5))
    write(tmp_path, leaf__png=png((10, 200, 10)), hole__png=png((51, 51, 51)), m__mtl=mtl)
    write(tmp_path, m__obj=many_materials(5))
    materials = load_mesh_file(tmp_path / "m.obj").materials
    assert len(materials) == 5
    assert len({id(m.texture) for m in materials}) == 1


def test_textures_made_of_two_count_towards_the_budget(tmp_path: Path) -> None:
    mtl = "".join(f"newmtl m{i}\nmap_Kd leaf.png\nmap_d hole{i}.png\n" for i in range(4))
    write(tmp_path, leaf__png=png((10, 200, 10)), m__mtl=mtl, m__obj=many_materials(4))
    for i in range(4):
        (tmp_path / f"hole{i}.png").write_bytes(png((51, 51, i)))
    told: list[str] = []
    # Sixteen pixels each: the leaf, and two opacity maps with what they are joined to.
    few = replace(DEFAULT_LIMITS, total_pixels=16 * 5)
    materials = load_mesh_file(tmp_path / "m.obj", limits=few, warn=told.append).materials
    depths = [m.texture.shape[2] for m in materials if m.texture is not None]
    assert sorted(depths) == [3, 4, 4]
    assert told


def test_materials_are_capped(tmp_path: Path) -> None:
    few = replace(DEFAULT_LIMITS, materials=4)
    with pytest.raises(InputError, match="more than the 4 materials"):
        load_mesh(many_materials(5).encode(), "m.obj", NoAssets(), limits=few)
    header, binary = triangle_gltf(materials=[{}] * 5)
    with pytest.raises(InputError, match="more than the 4 materials"):
        load_mesh(glb(header, binary), "t.glb", NoAssets(), limits=few)


@pytest.mark.parametrize("name", ["../secret.png", "a/../../secret.png", "..\\secret.png"])
def test_textures_outside_the_folder_are_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "secret.png").write_bytes(png())
    inner = tmp_path / "model"
    inner.mkdir()
    with pytest.raises(InputError, match=r"outside the model's folder"):
        load_square(inner, f"newmtl paint\nmap_Kd {name}\n")
    # The same reference is fine where the caller says that the folder above belongs to the model.
    if name == "../secret.png":
        mesh = load_mesh_file(inner / "square.obj", root=tmp_path)
        assert mesh.materials[0].texture is not None


def test_material_files_outside_the_folder_are_refused(tmp_path: Path) -> None:
    (tmp_path / "x.mtl").write_text("newmtl paint\nKd 1 0 0\n")
    (tmp_path / "m").mkdir()
    write(tmp_path / "m", c__obj="mtllib ../x.mtl\n" + CUBE)
    with pytest.raises(InputError, match="outside"):
        load_mesh_file(tmp_path / "m" / "c.obj")


def test_absolute_paths_are_looked_for_beside_the_model_only(tmp_path: Path) -> None:
    outside = tmp_path / "outside.png"
    outside.write_bytes(png())
    inner = tmp_path / "model"
    inner.mkdir()
    told: list[str] = []
    assert load_square(inner, f"newmtl paint\nmap_Kd {outside}\n", told).materials[0].texture is None
    write(inner, wood__png=png())
    assert load_square(inner, "newmtl paint\nmap_Kd C:\\art\\Wood.png\n").materials[0].texture is not None


def test_links_out_of_the_folder_are_refused(tmp_path: Path) -> None:
    (tmp_path / "secret.png").write_bytes(png())
    inner = tmp_path / "model"
    inner.mkdir()
    (inner / "wood.png").symlink_to(tmp_path / "secret.png")
    with pytest.raises(InputError, match="link"):
        load_square(inner, "newmtl paint\nmap_Kd wood.png\n")


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.obj", b"", "0 bytes"),
        ("a.obj", CUBE_VERTICES.encode(), "no faces"),
        ("a.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "finite"),
        ("a.obj", b"v 0 0 inf\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "finite"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "damaged"),
        ("a.obj", b"v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "no face with an area"),
        ("a.obj", b"\x7fELF\0\0\0 not text", "binary"),
        ("a.ply", b"plywood", "header"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 999999999999\nend_header\n", "announces"),
        ("a.stl", b"\0" * 80 + struct.pack("<I", 4_000_000_000), "stl"),
        ("a.glb", b"glTF", "cut off"),
        ("a.glb", glb({"asset": {"version": "1.0"}}), "glTF 1.0"),
        ("a.gltf", b"[1, 2]", "no JSON object"),
        ("a.gltf", b"{" * 100_000, "JSON"),
        ("a.dae", b"<xml/>", "not a mesh format"),
    ],
)
def test_bad_meshes_get_one_sentence(name: str, content: bytes, says: str) -> None:
    with pytest.raises(InputError) as caught:
        load_mesh(content, name, NoAssets())
    assert says in str(caught.value)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_counts_are_capped_before_parsing() -> None:
    few = replace(DEFAULT_LIMITS, faces=3)
    with pytest.raises(InputError, match="more than the 3 faces"):
        load_mesh(CUBE.encode(), "c.obj", NoAssets(), limits=few)
    with pytest.raises(InputError, match="more than the 5 vertices"):
        load_mesh(CUBE.encode(), "c.obj", NoAssets(), limits=replace(DEFAULT_LIMITS, vertices=5))
    # One face statement of many corners counts as the triangles it becomes.
    fan = "".join(f"v {i} {i * i} 0\n" for i in range(9)) + "f " + " ".join(str(i) for i in range(1, 10))
    with pytest.raises(InputError, match="more than the 3 faces"):
        load_mesh(fan.encode(), "c.obj", NoAssets(), limits=few)


@pytest.mark.parametrize("separator", [" ", "\t", " \\\n", " \\\r\n", "\u2028", " \x0b"])
def test_corners_of_one_face_are_counted_before_parsing(
    separator: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError("parsed")

    monkeypatch.setattr(loading_module, "load_obj", never)
    few = replace(DEFAULT_LIMITS, faces=3)
    points = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    long = "1/1/1 2/2/2 3/3/3 " * 500
    # Six corners are four triangles; faces of three corners in lines of their own count too.
    for faces in (
        "f " + separator.join("123123"),
        "f 1 2 3\n" * 4,
        "  f 1 2 -1\r" * 4,
        "f 1 2 3\nf 1 2 3 1 2",
        "f " + long,
    ):
        with pytest.raises(InputError, match="more than the 3 faces"):
            load_mesh((points + faces).encode(), "c.obj", NoAssets(), limits=few)
    with pytest.raises(InputError, match="parsed"):
        load_mesh((points + "f " + separator.join("12312")).encode(), "c.obj", NoAssets(), limits=few)


def test_old_line_endings_and_continued_lines() -> None:
    for text in (CUBE.replace("\n", "\r"), CUBE.replace("\n", "\r\n"), CUBE.replace(" 4 3\n", " \\\n4 3\n")):
        assert len(load_mesh(text.encode(), "c.obj", NoAssets()).faces) == 12


def test_ply_keeps_its_colours() -> None:
    text = (
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n"
        "0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 0 0\n3 0 1 2\n"
    )
    mesh = load_mesh(text.encode(), "t.ply", NoAssets())
    texture = mesh.materials[0].texture
    assert texture is not None
    assert texture.reshape(-1, 3).tolist() == [[255, 0, 0]]


def test_binary_stl() -> None:
    triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    mesh = load_mesh(b"\0" * 80 + struct.pack("<I", 1) + triangle, "t.stl", NoAssets())
    assert mesh.faces.shape == (1, 3)


_GLB = glb(*triangle_gltf())


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.sampled_from(
        [(CUBE.encode(), "a.obj"), (_GLB, "a.glb"), (json.dumps(triangle_gltf()[0]).encode(), "a.gltf")]
    ),
    st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 255)), min_size=1, max_size=12),
)
def test_damaged_bytes_never_raise_anything_else(
    source: tuple[bytes, str], changes: list[tuple[int, int]]
) -> None:
    data = bytearray(source[0])
    for at, value in changes:
        data[at % len(data)] = value
    try:
        mesh = load_mesh(bytes(data), source[1], NoAssets(), warn=lambda _: None)
    except InputError as error:
        assert source[1] in str(error)
    else:
        assert np.isfinite(mesh.vertices).all()
        assert len(mesh.faces)


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=300), st.sampled_from([".obj", ".glb", ".gltf", ".ply", ".stl"]))
def test_noise_is_refused(data: bytes, suffix: str) -> None:
    try:
        load_mesh(data, "noise" + suffix, NoAssets(), warn=lambda _: None)
    except InputError as error:
        assert "noise" + suffix in str(error)


def test_face_order_of_the_builders_cube_is_closed() -> None:
    # Every directed edge of a closed, evenly wound cube is met by its opposite.
    edges = set()
    for line in CUBE_FACES.split("\n")[:-1]:
        corners = [int(c) for c in line.split()[1:]]
        edges |= set(zip(corners, corners[1:] + corners[:1], strict=True))
    assert {(b, a) for a, b in edges} == edges
