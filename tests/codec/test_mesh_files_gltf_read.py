"""Whole glTF files: small ones that were read wrongly once, and random ones in every form that the format allows."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gltf_files import PYRAMID_FACES, GltfFile, area, pyramid_file, read, read_mesh, triangle_file
from meshtide_codec.attributes import Attribute
from meshtide_codec.errors import MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.read import load_scene, mesh_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

LIMITS = FileLimits(vertices=1000, faces=2000)


def fan_file() -> GltfFile:
    file = pyramid_file()
    points = np.array([[20, 0, 0], [23, 0, 0], [23, 2, 0], [20, 2, 0], [21, 1, 1.5]])
    fan = {"attributes": {"POSITION": file.accessor(points, "<f4")}, "indices": file.accessor(range(5), "<u2")}
    file.root["meshes"][0]["primitives"].append({**fan, "mode": 6})
    return file


DRACO = (
    "RFJBQ08CAgEBAAAABAQAAwAAAS8BARAB/wAAAQAJAwAAAgABAQAPAwEQLwEwAwAoggAAAKCqAgCraqoKALCqAEAAAAAAAP8/AAAAAAAAAAAAAAAAAAAA"
    "AEBADgA="
)


def draco_file() -> GltfFile:
    file = GltfFile()
    file.add("accessors", {"componentType": 5126, "count": 4, "type": "VEC3"})
    file.add("accessors", {"componentType": 5125, "count": 12, "type": "SCALAR"})
    packed = {"bufferView": file.view(base64.b64decode(DRACO)), "attributes": {"POSITION": 0}}
    extensions = {"KHR_draco_mesh_compression": packed}
    file.mesh({"attributes": {"POSITION": 0}, "indices": 1, "extensions": extensions})
    file.root["extensionsRequired"] = list(extensions)
    return file.shown({"mesh": 0})


@pytest.mark.parametrize(("file", "vertices", "faces", "surface"), [(fan_file(), 10, 9, None), (draco_file(), 4, 4, 9)])
def test_files_that_were_read_wrongly(file: GltfFile, vertices: int, faces: int, surface: float | None) -> None:
    for data, suffix in ((file.glb(), ".glb"), (file.gltf(), ".gltf")):
        mesh = read_mesh(data, suffix)
        assert (len(mesh.vertices), len(mesh.faces)) == (vertices, faces)
        assert surface is None or area(mesh) == pytest.approx(surface)


def test_a_file_is_read_by_its_path_with_its_buffer_beside(tmp_path: Path) -> None:
    file = pyramid_file()
    (tmp_path / "my data.bin").write_bytes(file.binary)
    (tmp_path / "a.gltf").write_bytes(file.gltf("my%20data.bin"))
    mesh = mesh_of(load_scene(tmp_path / "a.gltf")).mesh
    assert np.array_equal(mesh.faces, PYRAMID_FACES)
    with pytest.raises(MeshFileError, match="names another one, 'my data.bin'; put everything into one file"):
        load_scene(tmp_path / "a.gltf", alone=True)


def doubling(depth: int) -> list[dict[str, Any]]:
    return [*({"children": [level + 1, level + 1]} for level in range(depth)), {"mesh": 0}]


def accessor(**changes: Any) -> bytes:
    file = triangle_file()
    file.root["accessors"][0] |= changes
    return file.glb()


HOSTILE = {
    "a buffer elsewhere": (triangle_file(buffers=[{"byteLength": 36, "uri": "../secret"}]).glb(), "names another one"),
    "more elements than bytes": (accessor(count=4), "claims 4 elements, more than its view holds"),
    "a trillion elements": (accessor(count=10**12), "more than its view holds"),
    "doubling nodes": (triangle_file(nodes=doubling(40)).glb(), "has two parents"),
    "a circle": (triangle_file(nodes=[{"children": [1], "mesh": 0}, {"children": [0]}]).glb(), "its own ancestor"),
    "many copies": (
        triangle_file(nodes=[{"mesh": 0}] * 400, scenes=[{"nodes": list(range(400))}]).glb(),
        "claims 1200 vertices",
    ),
    "Draco without a word": (
        triangle_file(
            meshes=[{"primitives": [{"attributes": {}, "extensions": {"KHR_draco_mesh_compression": {}}}]}]
        ).glb(),
        "has no POSITION",
    ),
    "a compressed view that claims much": (
        triangle_file(
            bufferViews=[
                {
                    "buffer": 0,
                    "byteLength": 1 << 42,
                    "extensions": {
                        "EXT_meshopt_compression": {
                            "buffer": 0,
                            "byteLength": 36,
                            "byteStride": 4,
                            "count": 1 << 40,
                            "mode": "ATTRIBUTES",
                        }
                    },
                }
            ],
        ).glb(),
        "more than a file of",
    ),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_files_are_refused(case: str) -> None:
    data, message = HOSTILE[case]
    with pytest.raises(MeshFileError, match=message):
        read(data, limits=LIMITS)


class Random:
    """A random mesh, and a file that holds it in random legal forms."""

    def __init__(self, draw: st.DataObject) -> None:
        self.draw = draw
        self.file = GltfFile()

    def choice(self, *options: Any) -> Any:
        return self.draw.draw(st.sampled_from(options))

    def accessor(self, values: NDArray[Any]) -> int:
        """Plain, with a stride, sparse over another one, or sparse over nothing."""
        size = values.dtype.itemsize * values.shape[1]
        row_stride = self.choice(0, 0, size + -size % 4, size + -size % 4 + 4)
        form = self.choice("plain", "plain", "sparse", "sparse alone")
        self.file.view(b"\xee" * self.choice(0, 4, 12))
        if form == "plain":
            return self.file.accessor(values, stride=row_stride)
        base = np.zeros_like(values) if form == "sparse alone" else values.copy()
        changed = np.flatnonzero((values != base).any(axis=1))
        if form == "sparse":
            changed = np.arange(0, len(values), 2)
            base[changed] = 1
        index = self.file.accessor(base, stride=row_stride)
        row = self.file.root["accessors"][index]
        if form == "sparse alone":
            del row["bufferView"]
        component = self.choice(("<u1", 5121), ("<u2", 5123), ("<u4", 5125))
        row["sparse"] = {
            "count": len(changed),
            "indices": {
                "bufferView": self.file.view(changed.astype(component[0]).tobytes()),
                "componentType": component[1],
            },
            "values": {"bufferView": self.file.view(values[changed].tobytes())},
        }
        return index

    def faces(self, faces: NDArray[np.int64]) -> dict[str, Any]:
        """As a list of triangles, or each as a strip; with indices of any type that fits."""
        dtype = self.choice("<u1", "<u2", "<u4")
        return {"indices": self.accessor(faces.reshape(-1, 1).astype(dtype)), "mode": 4}

    def node(self, depth: int) -> tuple[dict[str, Any], NDArray[np.float64]]:
        """A node's transformation of powers of two and quarter turns, which numbers hold exactly."""
        scale = [self.choice(1.0, 2.0, -1.0, 0.5) for _ in range(3)]
        shift = [self.choice(0.0, 1.0, -4.0) for _ in range(3)]
        matrix = np.diag([*scale, 1.0])
        matrix[:3, 3] = shift
        if depth % 2:
            return {"matrix": matrix.T.reshape(-1).tolist()}, matrix
        return {"scale": scale, "translation": shift}, matrix


@given(st.data())
@settings(max_examples=40)
def test_random_files_in_random_forms_are_the_same_mesh(draw: st.DataObject) -> None:
    random = Random(draw)
    seed = draw.draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    count, face_count = int(rng.integers(3, 40)), int(rng.integers(1, 30))
    dtype = random.choice("<f4", "<f4", "<i2", "<u1")
    points = rng.integers(0, 100, (count, 3)).astype(dtype)
    faces = np.stack([rng.permutation(count)[:3] for _ in range(face_count)])
    colors = rng.integers(0, 256, (count, 4)).astype("<u1")
    attributes = {"POSITION": random.accessor(points), "COLOR_0": random.accessor(colors)}
    parts = np.array_split(faces, random.choice(1, 2, 3))
    random.file.mesh(*({"attributes": attributes, **random.faces(part)} for part in parts if len(part)))
    depth = random.choice(1, 2, 4)
    world = np.eye(4)
    nodes: list[dict[str, Any]] = []
    for level in range(depth):
        node, matrix = random.node(level)
        world = world @ matrix
        nodes.append({**node, **({"children": [level + 1]} if level + 1 < depth else {"mesh": 0})})
    random.file.root |= {"nodes": nodes, "scenes": [{"nodes": [0]}], "scene": 0}
    data, suffix = (random.file.glb(), ".glb") if random.choice(True, False) else (random.file.gltf(), ".gltf")
    mesh = read(data, suffix).mesh()
    expected = points.astype(float) @ world[:3, :3].T + world[:3, 3]
    turned = faces[:, [0, 2, 1]] if np.linalg.det(world) < 0 else faces
    assert np.array_equal(mesh.vertices, expected)
    assert np.array_equal(mesh.faces, turned)
    assert mesh.attributes[0].values.tolist() == colors.tolist()


def test_reading_takes_few_times_the_bytes_of_the_file() -> None:
    import tracemalloc

    rng = np.random.default_rng(0)
    file = GltfFile()
    attributes = {"POSITION": file.accessor(rng.random((30_000, 3)), "<f4")}
    attributes["NORMAL"] = file.accessor(rng.random((30_000, 3)), "<f4")
    indices = file.accessor(rng.integers(0, 30_000, 180_000), "<u4")
    file.mesh({"attributes": attributes, "indices": indices})
    data = file.shown({"mesh": 0}).glb()
    tracemalloc.start()
    scene = read(data)
    assert tracemalloc.get_traced_memory()[1] < 5 * len(data)
    tracemalloc.stop()
    assert scene.counts() == (30_000, 60_000)


def attributes_of(mesh: Mesh) -> dict[str, Attribute]:
    return {one.name: one for one in mesh.attributes}


def test_geometries_that_no_node_shows_are_kept() -> None:
    file = triangle_file()
    file.mesh({"attributes": {"POSITION": file.accessor([[0, 0, 1]] * 3, "<f4"), "_A": 0}}, name="unseen")
    scene = read(file)
    assert [len(geometry.faces) for geometry in scene.geometries] == [1, 1]
    assert scene.names == ("", "unseen")
    assert list(attributes_of(scene.geometries[1])) == ["_A"]
    assert scene.counts() == (3, 1)
    assert json.dumps(dict(scene.document)) == '{"asset": {"version": "2.0"}}'
