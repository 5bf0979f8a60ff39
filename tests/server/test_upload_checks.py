"""Crafted files that claim what they do not hold, name others, or would grow when read; and good ones that pass."""

from __future__ import annotations

import json
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from meshes import grid, tetrahedron
from meshtide_codec.errors import MeshFileError
from meshtide_codec.file_checks.text_lines import LONGEST_LINE
from meshtide_codec.mesh_files import load_mesh, save_mesh
from meshtide_server.upload_checks import UploadLimits, check_upload
from meshtide_server.upload_checks.glb import LARGEST_JSON

LIMITS = UploadLimits(vertices=1000, faces=2000)
XYZ = "property float x\nproperty float y\nproperty float z\n"
FACES = "property list uchar int vertex_indices\n"


def ply(vertices: object, faces: object, rows: bytes, form: str = "binary_little_endian") -> bytes:
    head = f"ply\nformat {form} 1.0\nelement vertex {vertices}\n{XYZ}element face {faces}\n{FACES}end_header\n"
    return head.encode() + rows


def document(**changes: Any) -> dict[str, Any]:
    """The JSON of a GLB file with one triangle, whose three vertices are 36 bytes."""
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36}],
    } | changes


def glb(text: dict[str, Any] | bytes, *, version: int = 2, length: int | None = None) -> bytes:
    body = text if isinstance(text, bytes) else json.dumps(text).encode()
    body += b" " * (-len(body) % 4)
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    chunks = struct.pack("<I4s", len(body), b"JSON") + body + struct.pack("<I4s", 36, b"BIN\0") + triangle
    return struct.pack("<4sII", b"glTF", version, 12 + len(chunks) if length is None else length) + chunks


def accessor(**changes: Any) -> dict[str, Any]:
    return document(accessors=[document()["accessors"][0] | changes])


def doubling(depth: int) -> list[dict[str, Any]]:
    """Nodes each of which shows the next one twice."""
    return [*({"children": [level + 1, level + 1]} for level in range(depth)), {"mesh": 0}]


TRIANGLE_OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
TRIANGLE_ROWS = b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
STL_TEXT = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"

HOSTILE: dict[str, tuple[str, bytes, str]] = {
    "a trillion vertices": (
        "a.ply",
        ply(10**12, 0, bytes(24)),
        "claims 1000000000000 vertices; .* takes 1000",
    ),
    "a count of no file": ("a.ply", ply("9" * 300, 0, b""), "declares 9+... rows, which no file holds"),
    "a count below zero": ("a.ply", ply(-5, 0, b""), "line 3 .* not understood"),
    "faces over the limit": ("a.ply", ply(3, 2001, bytes(99999)), "claims 2001 faces; .*MESHTIDE_MAX_FACES"),
    "binary rows missing": ("a.ply", ply(900, 3, bytes(100)), "at least 10803 bytes of rows, but 100 follow"),
    "text rows missing": ("a.ply", ply(900, 1, TRIANGLE_ROWS, "ascii"), "ends after 4 of the 900 rows of vertex"),
    "text faces missing": ("a.ply", ply(4, 1, TRIANGLE_ROWS, "ascii"), "ends after 0 of the 1 rows of face"),
    "text values missing": ("a.ply", ply(1, 0, b"1 2\n", "ascii"), "row 0 of vertex has fewer values"),
    "no end of the header": ("a.ply", b"ply\nformat ascii 1.0\n" + b"comment\n" * 5000, "no end_header"),
    "no format": ("a.ply", b"ply\nend_header\n", "line 2 .* not understood"),
    "endless header line": ("a.ply", b"ply\ncomment " + b"x" * LONGEST_LINE, "a line is longer"),
    "four billion facets": (
        "a.stl",
        bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(50),
        "declares 4294967295",
    ),
    "facets over the limit": ("a.stl", bytes(80) + struct.pack("<I", 400) + bytes(20000), "claims 1200 vertices"),
    "half a facet": ("a.stl", STL_TEXT + b"facet\nvertex 0 0 0\n", "2 facets and 4 vertices"),
    "many text facets": ("a.stl", STL_TEXT * 400, "claims 1001 vertices"),
    "an empty file": ("a.stl", b"", "declares 0 facets"),
    "OFF, a trillion vertices": ("a.off", b"OFF\n1000000000000 1 0\n", "claims 1000000000000 vertices"),
    "OFF, rows missing": ("a.off", b"OFF 900 5 0\n0 0 0\n", "900 vertices and 5 faces, but 1 lines follow"),
    "OFF, counts that are words": ("a.off", b"OFF\nmany faces\n", "does not tell its numbers"),
    "OFF, not one": ("a.off", b"hello\n", "does not begin with OFF"),
    "OBJ, many vertices": ("a.obj", b"v 0 0 0\n" * 1001, "claims 1001 vertices"),
    "OBJ, one huge polygon": ("a.obj", b"v 0 0 0\nf" + b" 1" * 3000, "claims 2998 faces"),
    "OBJ, an endless line": ("a.obj", b"v " + b"0" * LONGEST_LINE, "a line is longer"),
    "OBJ, materials above": ("a.obj", b"mtllib ../../etc/passwd\n" + TRIANGLE_OBJ, "names a file elsewhere"),
    "OBJ, materials by path": ("a.obj", b"mtllib /etc/passwd\n" + TRIANGLE_OBJ, "names a file elsewhere"),
    "OBJ, materials on a drive": ("a.obj", b"mtllib C:\\secret\n" + TRIANGLE_OBJ, "names a file elsewhere"),
    "OBJ, nothing in it": ("a.obj", b"# hello\n", "holds no mesh"),
    "GLB, a buffer elsewhere": (
        "a.glb",
        glb(document(buffers=[{"byteLength": 36, "uri": "../secret"}])),
        r"buffers\[0\] .* names another file",
    ),
    "GLB, an image elsewhere": (
        "a.glb",
        glb(document(images=[{"uri": "file:///etc/passwd"}])),
        r"images\[0\] .* names another file",
    ),
    "GLB, an odd view": (
        "a.glb",
        glb(accessor(count=10**12, bufferView=None)),
        "bufferView .* not a number",
    ),
    "GLB, no view": (
        "a.glb",
        glb(document(accessors=[{"componentType": 5126, "count": 10**12, "type": "VEC3"}])),
        "no bytes stand behind it",
    ),
    "GLB, more elements than bytes": ("a.glb", glb(accessor(count=4)), "claims 4 elements, more than its view holds"),
    "GLB, a negative count": ("a.glb", glb(accessor(count=-1)), "count .* not a number from 0 on"),
    "GLB, an unknown type": ("a.glb", glb(accessor(type="VEC9")), "of an unknown type"),
    "GLB, a view outside": (
        "a.glb",
        glb(document(bufferViews=[{"buffer": 0, "byteOffset": 1, "byteLength": 36}])),
        "lies outside of its buffer",
    ),
    "GLB, a huge buffer": ("a.glb", glb(document(buffers=[{"byteLength": 1 << 40}])), "bytes of buffers, but holds"),
    "GLB, doubling nodes": ("a.glb", glb(document(nodes=doubling(40))), "has two parents"),
    "GLB, a circle of nodes": (
        "a.glb",
        glb(document(nodes=[{"children": [1], "mesh": 0}, {"children": [0]}])),
        "its own ancestor",
    ),
    "GLB, many copies": ("a.glb", glb(document(nodes=[{"mesh": 0}] * 400)), "claims 1200 vertices"),
    "GLB, a mesh that is not there": ("a.glb", glb(document(nodes=[{"mesh": 7}])), "shows mesh 7"),
    "GLB, compressed": (
        "a.glb",
        glb(document(extensionsUsed=["KHR_draco_mesh_compression"])),
        "compressed by KHR_draco_mesh_compression",
    ),
    "GLB, compressed without a word": (
        "a.glb",
        glb(document(meshes=[{"primitives": [{"extensions": {"KHR_draco_mesh_compression": {}}}]}])),
        "compressed by KHR_draco_mesh_compression",
    ),
    "GLB, a compressed view": (
        "a.glb",
        glb(document(bufferViews=[{"extensions": {"EXT_meshopt_compression": {"count": 1 << 40}}}])),
        "compressed by EXT_meshopt_compression",
    ),
    "GLB, a mode that is a list": (
        "a.glb",
        glb(document(meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "mode": [5]}]}])),
        "mode .* not a number from 0 on",
    ),
    "GLB, huge JSON": ("a.glb", glb(b'{"a":"' + b"x" * LARGEST_JSON + b'"}'), "bytes of JSON"),
    "GLB, deep JSON": ("a.glb", glb(b"[" * 200_000), "cannot be read"),
    "GLB, JSON that is a list": ("a.glb", glb(b"[]"), "not an object"),
    "GLB, a wrong length": ("a.glb", glb(document(), length=2**32 - 1), "claims 4294967295 bytes"),
    "GLB, a chunk of four gigabytes": (
        "a.glb",
        glb(document())[:-44] + struct.pack("<I4s", 2**32 - 1, b"BIN\0") + bytes(36),
        "a chunk .* claims 4294967295 bytes, but 36 follow",
    ),
    "GLB, version 1": ("a.glb", glb(document(), version=1), "not a GLB file of version 2"),
    "GLB, cut off": ("a.glb", glb(document())[:15], "ends within its header"),
    "another format's content": ("a.ply", glb(document()), "named \\*.ply, but its content is glb"),
    "a gzip archive": ("a.obj", b"\x1f\x8b\x08" + bytes(100), "its content is a gzip archive"),
    "an unknown suffix": ("a.3mf", b"hello", "not taken from strangers"),
    "a file of many": ("a.gltf", b"{}", "not taken from strangers"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_a_hostile_file_is_refused(tmp_path: Path, case: str) -> None:
    name, data, message = HOSTILE[case]
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(MeshFileError, match=message):
        check_upload(path, LIMITS)


def test_a_zip_bomb_by_the_name_of_a_mesh_is_refused_unopened(tmp_path: Path) -> None:
    path = tmp_path / "bomb.obj"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("mesh.obj", bytes(50_000_000))
    assert path.stat().st_size < 100_000
    with pytest.raises(MeshFileError, match="its content is a zip archive"):
        check_upload(path, LIMITS)


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".off", ".stl", ".glb"])
@pytest.mark.parametrize("mesh", [tetrahedron(), grid(9)], ids=["tetrahedron", "grid"])
def test_what_is_written_passes(tmp_path: Path, suffix: str, mesh: Any) -> None:
    path = tmp_path / f"mesh{suffix}"
    save_mesh(mesh, path)
    check_upload(path, LIMITS)
    assert len(load_mesh(path).faces) == len(mesh.faces)


@pytest.mark.parametrize(
    ("name", "data", "faces"),
    [
        ("text.ply", ply(3, 1, TRIANGLE_ROWS, "ascii"), 1),
        ("text.stl", STL_TEXT + b"endsolid a\n", 1),
        ("one-line.off", b"OFF 3 1 0\n" + TRIANGLE_ROWS, 1),
        ("materials.obj", b"mtllib ./a.mtl\nusemtl x\n" + TRIANGLE_OBJ, 1),
        ("triangle.glb", glb(document()), 1),
        ("copies.glb", glb(document(nodes=[{"children": [1, 2]}, {"mesh": 0}, {"mesh": 0}])), 2),
    ],
)
def test_other_ways_to_write_a_good_file_pass(tmp_path: Path, name: str, data: bytes, faces: int) -> None:
    path = tmp_path / name
    path.write_bytes(data)
    check_upload(path, LIMITS)
    assert len(load_mesh(path).faces) == faces


def places_in(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The way to each value within JSON."""
    inner: Any = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(place for key, item in inner for place in places_in(item, (*path, key)))]


JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 1 << 40) | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["mode", "uri", "mesh"]), inner),
    max_leaves=4,
)


@given(st.data())
@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_value_anywhere_in_a_glb_file_is_taken_or_refused_with_a_reason(
    tmp_path: Path, data: st.DataObject
) -> None:
    primitive = {"attributes": {"POSITION": 0, "NORMAL": 0}, "indices": 0, "mode": 4, "extensions": {}}
    whole = document(
        meshes=[{"primitives": [primitive]}],
        nodes=[{"mesh": 0, "children": [1]}, {"mesh": 0}],
        images=[{"uri": "data:,"}],
        extensionsUsed=["KHR_mesh_quantization"],
    )
    *way, last = data.draw(st.sampled_from(places_in(whole)[1:]))
    place: Any = whole
    for key in way:
        place = place[key]
    place[last] = data.draw(JSON)
    path = tmp_path / "any.glb"
    path.write_bytes(glb(whole))
    try:
        check_upload(path, LIMITS)
    except MeshFileError as error:
        assert str(error)
