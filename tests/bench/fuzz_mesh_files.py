"""Damaged mesh files for the readers: they may refuse a file or read it, but never raise anything else, hang or grow.

The files are those of tests/codec/cases and what the writers make of small meshes with colours, texture coordinates
and polygons; every fourth file is packed by gzip before or after it is damaged.

    python tests/bench/fuzz_mesh_files.py --seconds 600
"""

from __future__ import annotations

import gzip
import sys
import tempfile
import warnings
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from damage import damaged
from fuzzing_files import run

from meshtide_codec.attributes import Attribute, Domain, Kind
from meshtide_codec.errors import MeshError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import mesh_of, save_scene
from meshtide_codec.mesh_files.read import read_source
from meshtide_codec.mesh_files.source import open_source
from meshtide_codec.scene import Image, Material, Scene
from meshtide_codec.testing import grid, shapes

if TYPE_CHECKING:
    import random

CASES = Path(__file__).parents[1] / "codec" / "cases"
SUFFIXES = (".obj", ".ply", ".off", ".stl", ".glb", ".gltf")
LIMITS = FileLimits(vertices=200_000, faces=400_000, file_bytes=1 << 26)
_FOLDER = Path(tempfile.mkdtemp(prefix="meshtide-fuzz-"))


def attempt(pick: random.Random) -> str:
    """Damage one file and read it as a stranger's or, every other time, as one's own with what lies beside it."""
    suffix, body = pick.choice(_files())
    packed = pick.random()
    if packed < 0.1:
        body = gzip.compress(damaged(pick, suffix, body))
    elif packed < 0.2:
        body = damaged(pick, ".tide", gzip.compress(body))
    else:
        body = damaged(pick, suffix, body)
    path = _FOLDER / f"file{suffix}"
    path.write_bytes(body)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        source = open_source(path, LIMITS, alone=pick.random() < 0.5)
        loaded = mesh_of(read_source(source, LIMITS), path.name).mesh
    if not np.isfinite(loaded.vertices).all() or (len(loaded.faces) and loaded.faces.max() >= len(loaded.vertices)):
        raise AssertionError("what was read is not a mesh")
    return "read"


@cache
def _files() -> list[tuple[str, bytes]]:
    """Suffix and content of all files that are damaged."""
    found = [(path.suffix, path.read_bytes()) for path in sorted(CASES.iterdir()) if path.suffix in SUFFIXES]
    for path in CASES.iterdir():
        (_FOLDER / path.name).write_bytes(path.read_bytes())
    small = [(suffix, body) for suffix, body in found if len(body) < 8000]
    for scene in _scenes():
        for suffix in SUFFIXES:
            path = _FOLDER / f"whole{suffix}"
            save_scene(scene, path)
            small.append((suffix, path.read_bytes()))
    return small


def _scenes() -> list[Scene]:
    meshes = [make() for make in shapes().values()]
    scenes = [Scene.of(mesh) for mesh in meshes if len(mesh.faces)]
    plain = grid(4)
    corners = np.arange(3 * len(plain.faces)).reshape(-1, 3)
    uv = np.arange(2.0 * corners.size).reshape(-1, 2) / corners.size
    colours = np.full((len(plain.vertices), 4), 7, np.uint8)
    attributes = (
        Attribute("TEXCOORD_0", Kind.TEXCOORD, Domain.CORNER, uv, corners),
        Attribute("COLOR_0", Kind.COLOR, Domain.VERTEX, colours, normalized=True),
        Attribute("quality", Kind.SCALAR, Domain.FACE, np.arange(float(len(plain.faces)))[:, None]),
    )
    materials = np.arange(len(plain.faces)) % 2
    rich = Mesh.checked(plain.vertices, plain.faces, attributes, materials)
    red = Material("red", {"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "baseColorTexture": {"index": 0}}})
    image = Image("one.png", b"\x89PNG\r\n\x1a\n", "image/png")
    textured = replace(Scene.of(rich, [red, Material("blue")]), images=(image,), document={"textures": [{"source": 0}]})
    return [*scenes, textured]


if __name__ == "__main__":
    sys.exit(run(__doc__, attempt, (MeshError,)))
