"""Mesh files that benches read: generated, of any number of vertices, in the forms that each format has."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from large_meshes import wavy_torus
from mesh_file_samples_gltf import chain, grid, textured

from gltf_files import GltfFile
from meshtide_codec.attributes import Attribute, Domain, Kind
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.ply import write_ply
from meshtide_codec.mesh_files.stl import write_stl
from meshtide_codec.scene import Scene

Sample = tuple[str, Callable[[Path], object]]
"""The name of a file, and what writes it."""


def samples(kind: str, vertices: int) -> Iterator[Sample]:
    """The files of a format: obj, ply, off, stl or gltf."""
    return {"obj": _obj, "ply": _ply, "off": _off, "stl": _stl, "gltf": _gltf}[kind](vertices)


def _obj(vertices: int) -> Iterator[Sample]:
    for form in ("v", "v/vt", "v/vt/vn"):
        yield f"{form.replace('/', '-')}.obj", partial(write_obj, vertices=vertices, form=form)
    yield "quads.obj", partial(write_obj, vertices=vertices, form="v", polygons=True)


def _ply(vertices: int) -> Iterator[Sample]:
    mesh = wavy_torus(vertices)
    data: dict[str, Callable[[], bytes]] = {
        "text": lambda: _text(mesh),
        "float": lambda: _floats(mesh, "<"),
        "float-big-endian": lambda: _floats(mesh, ">"),
        "double": lambda: write_ply(Scene.of(mesh), "mesh.ply").data,
        "triangles-and-quads": lambda: _mixed(mesh),
        "attributes": lambda: write_ply(Scene.of(_dressed(mesh)), "mesh.ply").data,
    }
    for name, make in data.items():
        yield f"{name}.ply", partial(_write, make=make)


def _off(vertices: int) -> Iterator[Sample]:
    points, quads = torus(vertices)
    quads = quads - 1
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    for name, faces in (("triangles", triangles), ("quads", quads)):
        yield f"{name}.off", partial(_write, make=partial(_off_text, points, faces))


def _stl(vertices: int) -> Iterator[Sample]:
    mesh = wavy_torus(vertices)
    plain = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    yield "binary.stl", partial(_write, make=lambda: write_stl(Scene.of(mesh), "a.stl").data)
    yield "text.stl", partial(_write, make=lambda: str(plain.export(file_type="stl_ascii")).encode())


def _gltf(vertices: int) -> Iterator[Sample]:
    side = round(vertices**0.5)
    files = {
        "grid": lambda: grid(side, packed=False),
        "meshopt": lambda: grid(side // 2, packed=True),
        "texture-of-4096": lambda: textured(1, 4096),
        "20-textures-of-2048": lambda: textured(20, 2048),
        "chain-of-1000-nodes": lambda: chain(1000),
    }
    for name, make in files.items():
        yield f"{name}.glb", partial(_write_glb, make=make)


def _write(path: Path, make: Callable[[], bytes]) -> None:
    path.write_bytes(make())


def _write_glb(path: Path, make: Callable[[], GltfFile]) -> None:
    path.write_bytes(make().glb())


def torus(vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) of a bumpy torus and its quadrilaterals (n, 4) from 1."""
    side = round(vertices**0.5)
    u, v = np.meshgrid(np.arange(side) * 2 * np.pi / side, np.arange(side) * 2 * np.pi / side, indexing="ij")
    radius = 1 + 0.3 * np.cos(v)
    points = np.stack([radius * np.cos(u), radius * np.sin(u), 0.3 * np.sin(v) + 0.01 * np.sin(20 * u)], axis=-1)
    corner = np.arange(side * side).reshape(side, side)
    after = np.roll(corner, -1, axis=0)
    quads = np.stack([corner, after, np.roll(after, -1, axis=1), np.roll(corner, -1, axis=1)], axis=-1)
    return points.reshape(-1, 3), quads.reshape(-1, 4) + 1


def write_obj(path: Path, vertices: int, form: str, *, polygons: bool = False) -> None:
    """A large OBJ file whose corners have the form v, v/vt, v//vn or v/vt/vn."""
    points, quads = torus(vertices)
    faces = quads if polygons else np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    corner = form.replace("vt", "{0}").replace("vn", "{0}").replace("v", "{0}").replace("{0}", "%d")
    line = f"f {' '.join([corner] * faces.shape[1])}\n"
    with path.open("w") as file:
        file.writelines(f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in points.tolist())
        if "vt" in form:
            file.writelines(f"vt {u:.6f} {v:.6f}\n" for u, v in (points[:, :2] / 3 + 0.5).tolist())
        if "vn" in form:
            file.writelines(f"vn {x:.4f} {y:.4f} {z:.4f}\n" for x, y, z in points.tolist())
        file.writelines(line % tuple(row) for row in np.repeat(faces, corner.count("%d"), axis=1).tolist())


def _off_text(points: np.ndarray, faces: np.ndarray) -> bytes:
    lines = [f"OFF\n{len(points)} {len(faces)} 0\n"]
    lines += [f"{x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points.tolist()]
    lines += [f"{len(row)} {' '.join(map(str, row))}\n" for row in faces.tolist()]
    return "".join(lines).encode()


def _dressed(mesh: Mesh) -> Mesh:
    """The mesh with colours, normals, and texture coordinates of corners."""
    colours = np.random.default_rng(0).integers(0, 256, (len(mesh.vertices), 4)).astype(np.uint8)
    corners = np.random.default_rng(0).random((3 * len(mesh.faces), 2)).astype(np.float32)
    attributes = (
        Attribute("COLOR_0", Kind.COLOR, Domain.VERTEX, colours, normalized=True),
        Attribute("NORMAL", Kind.NORMAL, Domain.VERTEX, mesh.vertices.astype(np.float32)),
        Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.CORNER, corners),
    )
    return Mesh(mesh.vertices, mesh.faces, attributes)


def _header(mesh: Mesh, form: str, faces: int) -> bytes:
    xyz = "".join(f"property float {axis}\n" for axis in "xyz")
    rest = f"element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    return f"ply\nformat {form} 1.0\nelement vertex {len(mesh.vertices)}\n{xyz}{rest}".encode()


def _text(mesh: Mesh) -> bytes:
    vertices = "%.6f %.6f %.6f\n" * len(mesh.vertices) % tuple(mesh.vertices.reshape(-1).tolist())
    faces = "3 %d %d %d\n" * len(mesh.faces) % tuple(mesh.faces.reshape(-1).tolist())
    return _header(mesh, "ascii", len(mesh.faces)) + vertices.encode() + faces.encode()


def _floats(mesh: Mesh, order: str) -> bytes:
    rows = np.empty(len(mesh.faces), [("count", "u1"), ("corners", f"{order}i4", 3)])
    rows["count"], rows["corners"] = 3, mesh.faces
    form = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    return _header(mesh, form, len(rows)) + mesh.vertices.astype(f"{order}f4").tobytes() + rows.tobytes()


def _mixed(mesh: Mesh) -> bytes:
    """The same surface, of which about half of the squares are cut into triangles, at random."""
    half = len(mesh.faces) // 2
    first, second = mesh.faces[:half], mesh.faces[half:]
    squares = np.stack([first[:, 0], first[:, 1], second[:, 2], first[:, 2]], axis=1)
    whole = np.random.default_rng(0).random(half) < 0.5
    lists: list[bytes] = []
    quads, lower, upper = _rows(squares), _rows(first), _rows(second)
    for at, kept in enumerate(whole.tolist()):
        lists += (
            [quads[17 * at : 17 * at + 17]] if kept else [lower[13 * at : 13 * at + 13], upper[13 * at : 13 * at + 13]]
        )
    body = b"".join(lists)
    header = _header(mesh, "binary_little_endian", len(lists))
    return header + mesh.vertices.astype("<f4").tobytes() + body


def _rows(corners: np.ndarray[Any, Any]) -> bytes:
    rows = np.empty(len(corners), [("count", "u1"), ("corners", "<i4", corners.shape[1])])
    rows["count"], rows["corners"] = corners.shape[1], corners
    return rows.tobytes()
