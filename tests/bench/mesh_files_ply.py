"""Reading of PLY files: python tests/bench/mesh_files_ply.py [--vertices 1000000] [--rounds 3].

Files of a generated mesh (as text, binary, of mixed polygons, with attributes) are read here and by trimesh, each time
in a process of its own: the least seconds of the processor, and the peak of memory above that of a process that has
only loaded the reader, as a multiple of the file (Linux). A dash: trimesh does not read the file.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from large_meshes import wavy_torus

from meshtide_codec.attributes import Attribute, Domain, Kind
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.ply import write_ply
from meshtide_codec.scene import Scene

READ = """
import sys, time, warnings
warnings.simplefilter("ignore")
def peak():
    lines = open("/proc/self/status").read().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
path, small, who = sys.argv[1:]
if who == "trimesh":
    import trimesh
    def read(path): return trimesh.load(path, process=False, maintain_order=True)
else:
    from meshtide_codec.mesh_files import load_scene as read_scene
    def read(path): return read_scene(path).geometries[0]
read(small)  # loads what is loaded late
before, start = peak(), time.process_time()
mesh = read(path)
seconds = time.process_time() - start
print(seconds, (peak() - before) * 1024, len(mesh.faces))
"""


def files(vertex_count: int) -> Iterator[tuple[str, bytes]]:
    """Names and bytes of files of one mesh in several forms."""
    mesh = wavy_torus(vertex_count)
    yield "text", _text(mesh)
    yield "binary, float", _floats(mesh, "<")
    yield "binary, float, big endian", _floats(mesh, ">")
    yield "binary, double", write_ply(Scene.of(mesh), "mesh.ply").data
    yield "binary, triangles and quads", _mixed(mesh)
    colours = np.random.default_rng(0).integers(0, 256, (len(mesh.vertices), 4)).astype(np.uint8)
    corners = np.random.default_rng(0).random((3 * len(mesh.faces), 2)).astype(np.float32)
    attributes = (
        Attribute("COLOR_0", Kind.COLOR, Domain.VERTEX, colours, normalized=True),
        Attribute("NORMAL", Kind.NORMAL, Domain.VERTEX, mesh.vertices.astype(np.float32)),
        Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.CORNER, corners),
    )
    dressed = Mesh(mesh.vertices, mesh.faces, attributes)
    yield "binary, with attributes", write_ply(Scene.of(dressed), "mesh.ply").data


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


def measured(path: Path, small: Path, who: str, rounds: int) -> tuple[float, int] | None:
    """The least seconds and bytes of some readings by `meshtide` or `trimesh`; None if it does not read the file."""
    found = []
    for _ in range(rounds):
        command = [sys.executable, "-c", READ, str(path), str(small), who]
        run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False)
        if run.returncode:
            return None
        seconds, peak, _ = run.stdout.split()
        found.append((float(seconds), int(peak)))
    return min(seconds for seconds, _ in found), min(peak for _, peak in found)


def report(vertex_count: int, rounds: int) -> Iterator[str]:
    """A line for each file."""
    yield f"{'PLY':30} {'MB':>6} {'ours s':>7} {'trimesh s':>9} {'x faster':>8} {'memory / file':>13} {'trimesh':>8}"
    for name, data in files(vertex_count):
        with tempfile.TemporaryDirectory() as folder:
            path, small = Path(folder) / "mesh.ply", Path(folder) / "small.ply"
            path.write_bytes(data)
            small.write_bytes(_floats(wavy_torus(10), "<"))
            own = measured(path, small, "meshtide", rounds)
            other = measured(path, small, "trimesh", rounds)
        if own is None:
            raise SystemExit(f"{name}: not read")
        line = f"{name:30} {len(data) / 1e6:6.1f} {own[0]:7.3f} "
        memory = f"{own[1] / len(data):13.1f}"
        if other is None:
            yield f"{line}{'-':>9} {'-':>8} {memory} {'-':>8}"
        else:
            yield f"{line}{other[0]:9.3f} {other[0] / own[0]:8.1f} {memory} {other[1] / len(data):8.1f}"


def main() -> None:
    """Generate, read, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vertices", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    for line in report(arguments.vertices, arguments.rounds):
        print(line, flush=True)


if __name__ == "__main__":
    main()
