"""Reading of OFF and STL against trimesh: python tests/bench/mesh_files_off_stl.py [FILE ...] [--vertices 250000].

Seconds are the best of several rounds, in one process; memory is what is allocated at most, beside the file's own
bytes, as a multiple of its size. trimesh does not weld the corners of STL files unless it is asked to: both are shown.
"""

from __future__ import annotations

import argparse
import io
import time
import tracemalloc
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import trimesh

from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.formats import reader_of, writer_of
from meshtide_codec.mesh_files.source import Source, format_suffix
from meshtide_codec.scene import Scene

ROUNDS = 3


def main() -> None:
    """Read each file in both ways, print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, help="OFF and STL files; made ones are always added")
    parser.add_argument("--vertices", type=int, default=250_000, help="of the meshes that are made")
    arguments = parser.parse_args()
    print(f"{'file':24}{'MB':>8}{'faces':>9}{'ours s':>9}{'trimesh s':>11}{'welded s':>10}{'memory x':>10}")
    for name, data in [*((path.name, path.read_bytes()) for path in arguments.files), *made(arguments.vertices)]:
        kind = format_suffix(name)
        ours = seconds(partial(read, name, data))
        theirs = seconds(partial(foreign, kind, data, weld=False))
        welded = f"{seconds(partial(foreign, kind, data, weld=True)):.3f}" if kind == ".stl" else ""
        tracemalloc.start()
        mesh = read(name, data)
        peak = tracemalloc.get_traced_memory()[1] / len(data)
        tracemalloc.stop()
        print(
            f"{name:24}{len(data) / 1e6:8.2f}{len(mesh.faces):9}{ours:9.3f}{theirs:11.3f}{welded:>10}{peak:10.2f}",
            flush=True,
        )


def made(count: int) -> Iterator[tuple[str, bytes]]:
    """Files of a bumpy patch of about so many vertices, in each kind."""
    side = int(count**0.5)
    u, v = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    points = np.stack([u, v, np.sin(u * 0.7) + np.cos(v * 0.5)], axis=-1).reshape(-1, 3)
    points += np.random.default_rng(0).random(points.shape)
    corner = (u * side + v)[:-1, :-1].reshape(-1)
    lower = np.stack([corner, corner + side, corner + 1], axis=1)
    upper = np.stack([corner + 1, corner + side, corner + side + 1], axis=1)
    scene = Scene.of(Mesh.checked(points.astype(np.float32), np.concatenate([lower, upper])))
    for suffix in (".off", ".stl"):
        writer = writer_of(suffix)
        assert writer is not None
        yield f"binary{suffix}" if suffix == ".stl" else f"text{suffix}", writer(scene, "made").data
    mesh = scene.mesh()
    yield "quads.off", quads(points, side)
    plain = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    text = plain.export(file_type="stl_ascii")
    yield "text.stl", text.encode() if isinstance(text, str) else bytes(text)


def quads(points: np.ndarray, side: int) -> bytes:
    """The patch as quadrilaterals, in OFF."""
    corner = np.arange(side * side).reshape(side, side)[:-1, :-1].reshape(-1)
    faces = np.stack([corner, corner + side, corner + side + 1, corner + 1], axis=1)
    lines = [f"OFF\n{len(points)} {len(faces)} 0\n"]
    lines += [f"{x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points.tolist()]
    lines += [f"4 {a} {b} {c} {d}\n" for a, b, c, d in faces.tolist()]
    return "".join(lines).encode()


def read(name: str, data: bytes) -> Mesh:
    """By the reader of the format."""
    reader = reader_of(format_suffix(name))
    assert reader is not None
    return reader(Source(name, format_suffix(name), data), FileLimits()).mesh()


def foreign(kind: str, data: bytes, *, weld: bool) -> None:
    """By trimesh."""
    mesh = trimesh.load(io.BytesIO(data), file_type=kind.lstrip("."), process=False)
    if weld:
        mesh.merge_vertices()


def seconds(call: Callable[[], object]) -> float:
    """The shortest of some rounds."""
    best = float("inf")
    for _ in range(ROUNDS):
        start = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - start)
    return best


if __name__ == "__main__":
    main()
