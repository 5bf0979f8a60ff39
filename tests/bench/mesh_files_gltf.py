"""How long GLB files take to read, and how much memory, ours beside trimesh's reader.

    python tests/bench/mesh_files_gltf.py FOLDER

Files are those of the folder and some that are generated: textures of one colour, which are small as files and large
as pictures; a grid of a million vertices; a chain of nodes; and a grid as meshopt compresses it. Each is read in a
process of its own; of up to five readings the shortest counts. Memory is the peak of what Python allocates, as a
multiple of the file.
"""

from __future__ import annotations

import argparse
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from gltf_files import GltfFile
from meshopt_streams import encoded_indices

READ = {
    "ours": """
from meshtide_codec.mesh_files.read import load_scene, mesh_of
def read(path):
    return len(mesh_of(load_scene(path)).mesh.faces)
read(WARM)
""",
    "trimesh": """
import trimesh
def read(path):
    scene = trimesh.load(path, process=False)
    return len(scene.to_mesh().faces)
read(WARM)
""",
}
MEASURE = """
import sys, time, tracemalloc
WARM, PATH = sys.argv[1:3]
{reader}
seconds = []
while len(seconds) < 5 and sum(seconds) < 3:
    start = time.perf_counter()
    faces = read(PATH)
    seconds.append(time.perf_counter() - start)
tracemalloc.start()
read(PATH)
print(faces, min(seconds), tracemalloc.get_traced_memory()[1])
"""


def measured(reader: str, path: Path, warm: Path) -> str:
    """Faces, seconds, and memory as a multiple of the file."""
    command = [sys.executable, "-W", "ignore", "-c", MEASURE.format(reader=READ[reader]), str(warm), str(path)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=True)
    except subprocess.TimeoutExpired:
        return f"{'more than 100 s':>34}"
    except subprocess.CalledProcessError as error:
        return f"{'fails: ' + error.stderr.strip().splitlines()[-1][:40]:>34}"
    faces, seconds, memory = done.stdout.split()
    return f"{faces:>9} {float(seconds):8.3f} s {int(memory) / path.stat().st_size:8.1f} x"


def picture(side: int) -> bytes:
    """A PNG file of one colour."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    rows = zlib.compress((b"\0" + bytes(3 * side)) * side, 9)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def textured(count: int, side: int) -> GltfFile:
    """Triangles, each with a picture of its own."""
    file = GltfFile()
    position = file.accessor([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    coordinates = file.accessor([[0, 0], [1, 0], [0, 1]], "<f4")
    for index in range(count):
        file.add("images", {"bufferView": file.view(picture(side)), "mimeType": "image/png"})
        file.add("textures", {"source": index})
        file.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": index}}})
        file.mesh({"attributes": {"POSITION": position, "TEXCOORD_0": coordinates}, "material": index})
    return file.shown(*({"mesh": index} for index in range(count)))


def grid_faces(side: int) -> Any:
    """Triangles over side x side vertices."""
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1)
    lower = np.stack([corner, corner + side, corner + 1], axis=1)
    return np.concatenate([lower, np.stack([corner + 1, corner + side, corner + side + 1], axis=1)])


def grid(side: int, *, packed: bool) -> GltfFile:
    """A patch with normals; its indices compressed by meshopt, or as they are."""
    file = GltfFile()
    points = np.random.default_rng(0).random((side * side, 3))
    attributes = {"POSITION": file.accessor(points, "<f4"), "NORMAL": file.accessor(points, "<f4")}
    corners = grid_faces(side).reshape(-1)
    if packed:
        stream = encoded_indices(corners.tolist(), [0] * len(corners))
        row = {"buffer": 0, "byteOffset": len(file.binary), "byteLength": len(stream)}
        row |= {"byteStride": 4, "count": len(corners), "mode": "INDICES"}
        file.binary += stream + bytes(-len(stream) % 4)
        extensions = {"EXT_meshopt_compression": row}
        view = file.add("bufferViews", {"buffer": 1, "byteLength": 4 * len(corners), "extensions": extensions})
        indices = {"bufferView": view, "componentType": 5125, "count": len(corners), "type": "SCALAR"}
        file.mesh({"attributes": attributes, "indices": file.add("accessors", indices)})
        file.root["buffers"] = [{"byteLength": len(file.binary)}, {"byteLength": 4 * len(corners)}]
        file.root["extensionsRequired"] = file.root["extensionsUsed"] = list(extensions)
    else:
        file.mesh({"attributes": attributes, "indices": file.accessor(corners, "<u4")})
    return file.shown({"mesh": 0})


def chain(depth: int) -> GltfFile:
    """Nodes below one another, a triangle at the end."""
    file = GltfFile()
    file.mesh({"attributes": {"POSITION": file.accessor([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")}})
    nodes = [{"children": [index + 1], "translation": [0, 0, 1]} for index in range(depth)]
    file.root |= {"nodes": [*nodes, {"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}
    return file


def main() -> None:
    """Measure the files of a folder, and generated ones."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder: Path = parser.parse_args().folder
    with tempfile.TemporaryDirectory() as name:
        made = Path(name)
        generated = {
            "1 texture of 4096": textured(1, 4096),
            "20 textures of 2048": textured(20, 2048),
            "grid of 10^6 vertices": grid(1000, packed=False),
            "grid of 250 000, meshopt": grid(500, packed=True),
            "chain of 1000 nodes": chain(1000),
            "chain of 20000 nodes": chain(20_000),
        }
        files = sorted(folder.glob("*.glb"))
        for title, file in generated.items():
            files.append(made / f"{title}.glb")
            files[-1].write_bytes(file.glb())
        small = made / "warm.glb"
        small.write_bytes(chain(1).glb())
        print(f"{'':28}{'bytes':>10}   {'ours':^31}   {'trimesh':^31}")
        for path in files:
            both = "   ".join(measured(reader, path, small) for reader in READ)
            print(f"{path.stem:28}{path.stat().st_size:>10}   {both}", flush=True)


if __name__ == "__main__":
    main()
