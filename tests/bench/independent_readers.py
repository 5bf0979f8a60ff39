"""Holds what the readers make of a folder's files against readers of a page each, written without them.

OBJ and OFF are read word by word in plain Python; of GLB files, the positions, texture coordinates and triangles of all
nodes that are shown are taken from the accessors with struct. Compared are all positions, all polygons, and the wedges:
the distinct pairs of a position and a row of texture coordinates.

    python tests/bench/independent_readers.py FOLDER
"""

from __future__ import annotations

import argparse
import json
import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from meshtide_codec.attributes import Domain, Kind
from meshtide_codec.mesh_files import load_scene
from plain_obj import read_plain_obj

Table = dict[str, Any]


def read_obj(path: Path) -> Table:
    """Positions, polygons, and pairs of position and texture coordinates."""
    plain = read_plain_obj(path.read_bytes())
    wedges = [pair for pair in plain.wedges() if pair[1] is not None]
    polygons = [[vertex for vertex, _, _ in face] for face in plain.faces]
    return {"positions": np.array(plain.positions), "polygons": polygons, "wedges": len(wedges)}


def read_off(path: Path) -> Table:
    """Positions and polygons of a file whose rows have lines of their own."""
    lines = [line.partition("#")[0].split() for line in path.read_text().splitlines()]
    rows = [words for words in lines if words]
    vertices, faces = int(rows[1][0]), int(rows[1][1])
    positions = [[float(word) for word in row[:3]] for row in rows[2 : 2 + vertices]]
    polygons = [[int(word) for word in row[1 : 1 + int(row[0])]] for row in rows[2 + vertices : 2 + vertices + faces]]
    return {"positions": np.array(positions), "polygons": polygons, "wedges": 0}


_TYPES = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}
_SHAPES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def _world(gltf: Any, node: int) -> Any:
    row = gltf["nodes"][node]
    if "matrix" in row:
        local = np.array(row["matrix"], float).reshape(4, 4).T
    else:
        x, y, z, w = row.get("rotation", [0, 0, 0, 1])
        turn = np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ])  # fmt: skip
        local = np.eye(4)
        local[:3, :3] = turn * np.array(row.get("scale", [1, 1, 1]))
        local[:3, 3] = row.get("translation", [0, 0, 0])
    parents = [i for i, other in enumerate(gltf["nodes"]) if node in other.get("children", [])]
    return _world(gltf, parents[0]) @ local if parents else local


def read_glb(path: Path) -> Table:
    """All triangles that are shown; nodes are multiplied out, skins in their bind pose."""
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    gltf = json.loads(data[20 : 20 + length])
    binary = data[28 + length :]

    def accessor(index: int) -> np.ndarray[Any, Any]:
        row = gltf["accessors"][index]
        view = gltf["bufferViews"][row["bufferView"]]
        kind = np.dtype("<" + _TYPES[row["componentType"]]).newbyteorder("<")
        width = _SHAPES[row["type"]]
        start = view.get("byteOffset", 0) + row.get("byteOffset", 0)
        stride = view.get("byteStride", kind.itemsize * width)
        found = [np.frombuffer(binary, kind, width, start + i * stride) for i in range(row["count"])]
        return np.array(found)

    positions: list[Any] = []
    polygons: list[list[int]] = []
    wedges: set[tuple[int, ...]] = set()

    def below(number: int) -> list[int]:
        return [number, *(one for child in gltf["nodes"][number].get("children", []) for one in below(child))]

    for number in (one for root in gltf["scenes"][gltf.get("scene", 0)]["nodes"] for one in below(root)):
        node = gltf["nodes"][number]
        if "mesh" not in node:
            continue
        for primitive in gltf["meshes"][node["mesh"]]["primitives"]:
            held = primitive["attributes"]
            points = accessor(held["POSITION"]).astype(float)
            matrix = _world(gltf, number)
            if "skin" in node:
                skin = gltf["skins"][node["skin"]]
                inverse = accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1).astype(float)
                joints = np.array(
                    [_world(gltf, joint) @ bind for joint, bind in zip(skin["joints"], inverse, strict=True)]
                )
                weights = accessor(held["WEIGHTS_0"]).astype(float)
                posed = (joints[accessor(held["JOINTS_0"])] * weights[:, :, None, None]).sum(axis=1)
                points = np.einsum("nij,nj->ni", posed[:, :3], np.c_[points, np.ones(len(points))])
            else:
                points = points @ matrix[:3, :3].T + matrix[:3, 3]
            start = len(positions)
            positions += points.tolist()
            indices = accessor(primitive["indices"]).reshape(-1, 3).astype(int).tolist()
            flipped = np.linalg.det(matrix[:3, :3]) < 0 and "skin" not in node
            polygons += [[start + i for i in (row[::-1] if flipped else row)] for row in indices]
            if "TEXCOORD_0" in held:
                rows = np.unique(np.c_[points, accessor(held["TEXCOORD_0"])], axis=0)
                wedges |= {(start, i) for i in range(len(rows))}
    return {"positions": np.array(positions), "polygons": polygons, "wedges": len(wedges)}


READERS = {".obj": read_obj, ".off": read_off, ".glb": read_glb}


def ours(path: Path) -> Table:
    """The same of the readers of meshtide."""
    scene = load_scene(path)
    mesh = scene.mesh()
    count = 0
    for attribute in mesh.attributes:
        if attribute.name == "TEXCOORD_0" and attribute.kind is Kind.TEXCOORD:
            if attribute.domain is Domain.CORNER and path.suffix == ".obj":
                rows = attribute.rows()
                held = np.stack([mesh.faces.reshape(-1), rows], axis=1)[rows >= 0]
                count = len(np.unique(held, axis=0))
            elif attribute.domain is Domain.VERTEX:
                count = _wedges_of_parts(path)
    return {"positions": mesh.vertices, "polygons": mesh.polygons_as_lists(), "wedges": count}


def _wedges_of_parts(path: Path) -> int:
    """Distinct positions with texture coordinates in each primitive; ours share no vertices across primitives."""
    total = 0
    scene = load_scene(path)
    for index, matrix in scene.placements():
        part = scene.geometries[index]
        uv = next((one for one in part.attributes if one.name == "TEXCOORD_0"), None)
        if uv is None:
            continue
        rows = uv.rows()
        points = part.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        labels = np.zeros(len(points)) if part.materials is None else _material_of_vertices(part)
        held = np.c_[labels, points, uv.per_element()][rows >= 0]
        total += len(np.unique(held, axis=0))
    return total


def _material_of_vertices(part: Any) -> Any:
    labels = np.full(len(part.vertices), -1)
    labels[part.faces] = part.materials[:, None]
    return labels


def rotated(polygon: list[int]) -> tuple[int, ...]:
    """A polygon from its smallest vertex on."""
    first = polygon.index(min(polygon))
    return (*polygon[first:], *polygon[:first])


def main() -> int:
    """Print a row for each file; 1 if any differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of mesh files; what lies below it is read too")
    folder = parser.parse_args().folder
    failed = 0
    print(f"{'file':32}{'vertices':>10}{'polygons':>10}{'wedges':>8}  positions  polygons  wedges")
    for path in sorted(path for path in folder.rglob("*") if path.suffix in READERS):
        theirs, own = READERS[path.suffix](path), ours(path)
        # Poses are computed from 32-bit floats, in an order of one's own; all else is the very same numbers.
        slack = 1e-6 * float(np.abs(own["positions"]).max()) if path.suffix == ".glb" else 0.0
        same_positions = theirs["positions"].shape == own["positions"].shape and bool(
            np.abs(theirs["positions"] - own["positions"]).max() <= slack
        )
        same_polygons = sorted(map(rotated, theirs["polygons"])) == sorted(map(rotated, own["polygons"]))
        answers = [same_positions, same_polygons, theirs["wedges"] == own["wedges"]]
        failed += not all(answers)
        words = "  ".join("same" if answer else "OTHER" for answer in answers)
        print(f"{path.name:32}{len(own['positions']):>10}{len(own['polygons']):>10}{own['wedges']:>8}  {words}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
