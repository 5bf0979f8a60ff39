"""Reading mesh files, held against trimesh: python tests/bench/mesh_files.py FOLDER [--formats obj] [--vertices N].

For each file of a folder and for generated ones: seconds of processor time (the best of several), and the peak memory
of each reader as a multiple of the file's size, in a process of its own, without what the interpreter took before.
With --check, what is read of the folder's OBJ files is held against a reader in plain Python.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

sys.path.insert(0, str(Path(__file__).parents[1]))

READ = """
import gc, json, sys, time
from pathlib import Path
path, reader, repeats = sys.argv[1], sys.argv[2], int(sys.argv[3])
if reader == "ours":
    import mapbox_earcut
    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.formats import reader_of
    from meshtide_codec.mesh_files.source import open_source
    limits = FileLimits()
    suffix = Path(path).suffix.lower()
    read = lambda: reader_of(suffix)(open_source(path, limits), limits)
    reader_of(suffix)
else:
    import logging, warnings
    import trimesh
    warnings.simplefilter("ignore")
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    read = lambda: trimesh.load(path, process=False, maintain_order=True)
def peak():
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) * 1024
before, seconds, memory = peak(), [], 0
for _ in range(repeats):
    start = time.process_time()
    found = read()
    seconds.append(time.process_time() - start)
    memory = memory or peak() - before
    del found
    gc.collect()
print(json.dumps([min(seconds), memory]))
"""
MEBIBYTE = 1 << 20
FAST = 20 * MEBIBYTE
"""Files below that are read several times, and their memory is that of the interpreter rather than theirs."""


@dataclass(frozen=True)
class Row:
    """One file: its size, and of our reader and of trimesh seconds and peak memory in bytes."""

    name: str
    size: int
    ours: tuple[float, int]
    theirs: tuple[float, int]

    def __str__(self) -> str:
        faster = self.theirs[0] / self.ours[0]
        memory = f"{self.ours[1] / self.size:.1f} {self.theirs[1] / self.size:.1f}" if self.size >= MEBIBYTE else "- -"
        return f"{self.name} {self.size} {self.ours[0]:.4f} {self.theirs[0]:.4f} {faster:.2f} {memory}"


def measured(path: Path, reader: str) -> tuple[float, int]:
    repeats = 7 if path.stat().st_size < FAST else 2
    command = [sys.executable, "-c", READ, str(path), reader, str(repeats)]
    seconds, memory = json.loads(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout)
    return seconds, memory


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


GENERATED: dict[str, list[tuple[str, Callable[[Path, int], None]]]] = {
    "obj": [
        ("generated-v", lambda path, count: write_obj(path, count, "v")),
        ("generated-v-vt", lambda path, count: write_obj(path, count, "v/vt")),
        ("generated-v-vt-vn", lambda path, count: write_obj(path, count, "v/vt/vn")),
        ("generated-quads", lambda path, count: write_obj(path, count, "v", polygons=True)),
    ],
}
"""What is made for each format: a name, and what writes the file."""


def checked(path: Path) -> str:
    """What our reader and a plain one find in an OBJ file, and whether it is the same."""
    from meshtide_codec.mesh_files import load_scene
    from obj_files import faces_of
    from plain_obj import read_plain_obj, turned

    mesh = load_scene(path).geometries[0]
    plain = read_plain_obj(path.read_bytes())
    positions = np.array_equal(mesh.vertices, np.array(plain.positions))
    faces = faces_of(mesh)
    wedges = {(v, t) for face in faces for v, t, _ in face}
    same = positions and faces == [turned(face) for face in plain.faces] and wedges == plain.wedges()
    figures = f"{len(plain.positions)} {len(plain.faces)} {len(plain.wedges())}"
    return f"{path.name} {figures} {len(mesh.vertices)} {len(faces)} {len(wedges)} {'same' if same else 'DIFFERENT'}"


def tell(line: str) -> None:
    sys.stderr.write(f"{line}\n")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--formats", nargs="+", choices=list(GENERATED), default=list(GENERATED))
    parser.add_argument("--vertices", type=int, default=1_000_000, help="of the generated meshes; 0 for none")
    parser.add_argument("--check", action="store_true", help="hold OBJ files against a plain reader instead")
    arguments = parser.parse_args()
    suffixes = {f".{kind}" for kind in arguments.formats}
    folder = [] if arguments.folder is None else sorted(arguments.folder.iterdir())
    paths = [path for path in folder if path.suffix.lower() in suffixes]
    if arguments.check:
        print("file vertices polygons wedges (plain) vertices polygons wedges (ours)")
        for path in paths:
            print(checked(path), flush=True)
        return
    print("file bytes ours-s trimesh-s times-faster ours-memory/file trimesh-memory/file")
    for path in paths:
        print(Row(path.name, path.stat().st_size, measured(path, "ours"), measured(path, "trimesh")), flush=True)
    for kind in arguments.formats if arguments.vertices else []:
        for name, write in GENERATED[kind]:
            with tempfile.TemporaryDirectory() as temporary:
                path = Path(temporary) / f"{name}.{kind}"
                tell(f"writing {path.name}")
                write(path, arguments.vertices)
                tell("reading it")
                row = Row(path.name, path.stat().st_size, measured(path, "ours"), measured(path, "trimesh"))
                print(row, flush=True)


if __name__ == "__main__":
    main()
