from __future__ import annotations

from meshtide_codec.classic.encoder import ClassicEncoding
from meshtide_codec.classic.geometry_bytes import GeometryBytes, geometry_bytes
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.filters import FilterSpec
from meshtide_codec.quantize import quantize
from meshtide_codec.testing import grid


def test_coefficients_are_four_bytes_for_each_transition_and_coordinate() -> None:
    options = ClassicOptions(bits=8, coarsest_vertices=30, filter=FilterSpec("polynomial", degree=3))
    encoding = ClassicEncoding(quantize(grid(24), 8), options)
    sizes = geometry_bytes(encoding, 8)
    assert sizes.coefficients == 4 * 4 * 3 * (len(encoding.levels) - 1)
    assert sizes.coarsest == 3 * len(encoding.levels[-1].cells)
    assert sizes.vertices == 24 * 24
    assert sizes.total == sizes.coarsest + sizes.coefficients + sizes.differences


def test_the_paper_s_sphere_has_881_bytes_for_224_vertices() -> None:
    """Raw cells of 10 bits a coordinate account for 840 of them."""
    assert GeometryBytes(10242, 224 * 30 // 8, 72, 19762).rate < 16.20
