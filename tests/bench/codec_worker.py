"""Encodes and decodes for `figures.py`, which tells it line by line what: one program for this checkout and for others.

Each line of standard input is a JSON object, each line of output its answer. It uses nothing but what all checkouts
have: `load_mesh`, `encode`, `decode`, `CompactOptions`.
"""

from __future__ import annotations

import json
import sys
import time
from functools import cache
from typing import TYPE_CHECKING, Any

from large_meshes import wavy_torus

from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.encoder import encode
from meshtide_codec.mesh_files import load_mesh

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_codec.mesh import Mesh


@cache
def mesh_of(name: str) -> Mesh:
    """The mesh of a file, or a made one of `torus:VERTICES`."""
    kind, _, vertices = name.partition(":")
    return wavy_torus(int(vertices)) if kind == "torus" else load_mesh(name)


@cache
def stream_of(name: str, bits: int, effort: Any) -> bytes:
    """The file of a mesh, with the previews that are chosen for it."""
    return encode(mesh_of(name), CompactOptions(bits=bits, effort=effort)).to_bytes()


@cache
def draco_of(name: str, bits: int) -> bytes:
    """The Draco file of a mesh."""
    from meshtide_lab.comparison.draco import draco_encoded

    mesh = mesh_of(name)
    return draco_encoded(mesh.vertices, mesh.faces, bits)


def seconds(work: Callable[[], object]) -> float:
    """The processor time of this process, all threads."""
    start = time.process_time()
    work()
    return time.process_time() - start


def answer(what: str, name: str, bits: int, effort: Any) -> dict[str, Any]:
    """What one line asks for: processor seconds, or bytes."""
    match what:
        case "decode":
            data = stream_of(name, bits, effort)
            return {"value": seconds(lambda: decode(data)), "vertices": len(mesh_of(name).vertices)}
        case "encode":
            mesh, options = mesh_of(name), CompactOptions(bits=bits, effort=effort)
            return {"value": seconds(lambda: encode(mesh, options))}
        case "draco decode":
            from meshtide_lab.comparison.draco import draco_decoded

            file = draco_of(name, bits)
            return {"value": seconds(lambda: draco_decoded(file))}
        case "draco encode":
            return {"value": seconds(lambda: draco_of.__wrapped__(name, bits))}
        case "size":  # without previews: one level beside one Draco file
            options = CompactOptions(bits=bits, effort=effort, previews=())
            return {"value": len(encode(mesh_of(name), options).to_bytes())}
        case "draco size":
            return {"value": len(draco_of(name, bits))}
    raise ValueError(f"no such work: {what}")


def main() -> None:
    """Answer line by line."""
    for line in sys.stdin:
        print(json.dumps(answer(**json.loads(line))), flush=True)


if __name__ == "__main__":
    main()
