"""What the golden streams in tests/golden hold: meshes of integers only, so that every machine makes the same ones.

`tools/make_golden.py` writes them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.filters import FilterSpec
from meshtide_codec.mesh import Mesh
from meshtide_codec.profile import Profile
from meshtide_codec.quantize import quantize

GOLDEN = Path(__file__).parent / "golden"


def bowl() -> Mesh:
    """A curved patch of 17 x 17 vertices."""
    u, v = np.meshgrid(np.arange(17), np.arange(17), indexing="ij")
    height = (u - 8) ** 2 + (v - 8) ** 2 // 2 + (u * v) % 3
    corner = (u * 17 + v)[:-1, :-1].reshape(-1)
    lower = np.stack([corner, corner + 17, corner + 1], axis=1)
    upper = np.stack([corner + 1, corner + 17, corner + 18], axis=1)
    return Mesh.checked(np.stack([8 * u, 8 * v, height], axis=-1).reshape(-1, 3), np.concatenate([lower, upper]))


def dome(side: int = 21) -> Mesh:
    """A smooth hill of side x side vertices, which the display filter does good to."""
    u, v = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    height = 1000 - 7 * (u - 10) ** 2 - 3 * (v - 10) ** 2
    corner = (u * side + v)[:-1, :-1].reshape(-1)
    lower = np.stack([corner, corner + side, corner + 1], axis=1)
    upper = np.stack([corner + 1, corner + side, corner + side + 1], axis=1)
    return Mesh.checked(np.stack([63 * u, 71 * v, height], axis=-1).reshape(-1, 3), np.concatenate([lower, upper]))


def tangle() -> Mesh:
    """Triangles without any order: non-manifold edges, opposite faces, isolated and welded vertices."""
    step = np.arange(120)
    vertices = np.stack([step * 37 % 61, step * 23 % 59, step * 11 % 53], axis=1)
    faces = np.stack([step, (step * 7 + 1) % 110, (step * 13 + 5) % 110], axis=1)
    return Mesh.checked(np.concatenate([vertices, vertices[:9]]), np.concatenate([faces, faces[:20, ::-1]]))


def twins() -> Mesh:
    """The tangle and its mirror image across x, with some faces between the two."""
    one = tangle()
    count = len(one.vertices)
    vertices = np.concatenate([one.vertices, one.vertices * [-1, 1, 1] + [140, 0, 0]])
    step = np.arange(0, count, 5)
    between = np.stack([step, step + 1, step + count], axis=1)
    return Mesh.checked(vertices, np.concatenate([one.faces, one.faces[:, ::-1] + count, between]))


def scattered(seed: int) -> Mesh:
    """A small soup of triangles between points that follow each other without order."""
    numbers = [seed]
    for _ in range(900):
        numbers.append((numbers[-1] * 1103515245 + 12345) % (1 << 31))  # the C standard's example of a generator
    drawn = np.array(numbers[1:]) >> 12
    count = 20 + 7 * seed
    vertices = drawn[: 3 * count].reshape(-1, 3) % (8 << seed)
    corners = drawn[3 * count : 3 * count + 120 + 30 * seed].reshape(-1, 3) % count
    return Mesh.checked(vertices, corners)


@dataclass(frozen=True)
class Variant:
    """One of the golden streams: what is encoded, and how."""

    make: Callable[[], Mesh]
    options: Profile
    store_order: bool = False

    def encode(self) -> EncodedMesh:
        return encode(self.make(), self.options, store_order=self.store_order)

    def mesh(self) -> Mesh:
        """What its stream decodes to."""
        return quantize(self.make(), self.options.bits).mesh()

    @property
    def machines_agree(self) -> bool:
        """Whether all machines encode it to the same bytes: previews are fitted with sums whose order numpy chooses."""
        return not (isinstance(self.options, CompactOptions) and self.options.previews)


def _classic(make: Callable[[], Mesh], spec: FilterSpec, **options: object) -> Variant:
    return Variant(make, ClassicOptions(bits=8, coarsest_vertices=10, filter=spec, **options))  # type: ignore[arg-type]


def _compact(make: Callable[[], Mesh], **options: object) -> Variant:
    return Variant(make, CompactOptions(bits=8, **options))  # type: ignore[arg-type]


POWER = FilterSpec("polynomial", degree=3, basis="power")
CHEBYSHEV = FilterSpec("polynomial", degree=3, basis="chebyshev")

VARIANTS = {
    "classic-bowl-zeroth": _classic(bowl, FilterSpec("zeroth")),
    "classic-bowl-gaussian": _classic(bowl, FilterSpec("gaussian")),
    "classic-bowl-taubin": _classic(bowl, FilterSpec("taubin")),
    "classic-bowl-power": _classic(bowl, POWER),
    "classic-bowl-power-s2": _classic(bowl, POWER, variable_from=2),
    "classic-bowl-power-single": _classic(bowl, POWER, variable_from=99),
    "classic-bowl-power-levels": _classic(bowl, POWER, sent_levels=frozenset({0, 1})),
    "classic-bowl-chebyshev": _classic(bowl, CHEBYSHEV),
    "classic-bowl-chebyshev-s2": _classic(bowl, CHEBYSHEV, variable_from=2),
    "classic-bowl-rational": _classic(bowl, FilterSpec("rational", degree=1, denominator_degree=1)),
    "classic-bowl-k2": _classic(bowl, POWER, drop_bits=2),
    "classic-tangle-power": _classic(tangle, POWER),
    "compact-bowl": _compact(bowl),
    "compact-bowl-plain": _compact(bowl, mirror=False),
    "compact-bowl-slices": _compact(bowl, slices=3),
    "compact-dome": _compact(dome),
    "compact-dome-previews": _compact(partial(dome, 46), previews=(128, 32)),
    "compact-tangle": _compact(tangle),
    "compact-tangle-slices": _compact(tangle, slices=3),
    "compact-twins": _compact(twins),
    "compact-twins-slices": _compact(twins, slices=3),
    **{f"compact-scattered-{seed}": _compact(partial(scattered, seed)) for seed in range(1, 6)},
    "compact-bowl-high": _compact(bowl, effort="high"),
    "compact-dome-high": _compact(dome, effort="high"),
    "compact-tangle-high-slices": _compact(tangle, effort="high", slices=3),
    "compact-twins-high": _compact(twins, effort="high"),
    "compact-twins-order": Variant(twins, CompactOptions(bits=8), store_order=True),
}
