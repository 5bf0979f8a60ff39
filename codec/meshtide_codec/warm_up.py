"""Compile every kernel ahead of time and leave them in the cache: `python -m meshtide_codec.warm_up`.

An installation that is copied to many machines, such as a container image, is warmed up once where it is built.
"""

from __future__ import annotations

import sys

import numpy as np

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.encoder import encode
from meshtide_codec.filters import FilterSpec
from meshtide_codec.mesh import Mesh

_FILTERS = (
    FilterSpec("zeroth"),
    FilterSpec("taubin"),
    FilterSpec("polynomial", degree=1),
    FilterSpec("polynomial", degree=1, basis="chebyshev"),
    FilterSpec("rational", degree=1, denominator_degree=1),
)


def warm_up() -> int:
    """Encode and decode a small mesh in both profiles; returns how many streams were checked.

    Raises:
        RuntimeError: a stream did not decode to what was encoded, so this installation is broken.
    """
    mesh = _bent_grid(60)
    variants: list[CompactOptions | ClassicOptions] = [
        CompactOptions(bits=10, slices=2),
        *(ClassicOptions(filter=spec, coarsest_vertices=20) for spec in _FILTERS),
    ]
    for options in variants:
        encoded = encode(mesh, options)
        decoded = decode(encoded.to_bytes())
        expected = encoded.quantized.mesh()
        if not (np.array_equal(decoded.vertices, expected.vertices) and np.array_equal(decoded.faces, expected.faces)):
            raise RuntimeError(f"a stream with {options} does not decode to what was encoded")
    return len(variants)


def _bent_grid(side: int) -> Mesh:
    """A curved patch of side x side vertices with an opposite face and a face across, so that no kernel sleeps."""
    u, v = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    vertices = np.stack([u, v, 0.05 * (u - side / 2) ** 2 + 0.03 * v * v], axis=-1).reshape(-1, 3)
    corner = (u * side + v)[:-1, :-1].reshape(-1)
    lower = np.stack([corner, corner + side, corner + 1], axis=1)
    upper = np.stack([corner + 1, corner + side, corner + side + 1], axis=1)
    extra = np.array([[side, 0, 1], [0, side // 2, side * side - 1]])
    return Mesh.checked(vertices, np.concatenate([lower, upper, extra]))


if __name__ == "__main__":
    sys.stdout.write(f"kernels compiled; {warm_up()} streams checked\n")
