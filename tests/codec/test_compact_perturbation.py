"""Perturbed Diffs: what the hook is told, how far vertices move, and that compact ones stay in their leaf cells."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from meshes import grid
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.octree import build_octree
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.samples import load_sample
from meshtide_codec.stream.packets import PacketKind

Differences = NDArray[np.float64]
BITS = 11


def steps(encoded: EncodedMesh, decoder: Decoder, level: int) -> Differences:
    """Vertices of a level in finest steps."""
    header = encoded.header
    vertices = decoder.mesh(level).vertices
    positions: Differences = (vertices - header.origin) / header.extent * ((1 << header.bits) - 1)
    return positions


def decoded(encoded: EncodedMesh, perturb: object = None) -> Decoder:
    decoder = Decoder(encoded.header, perturb=perturb)  # type: ignore[arg-type]
    for packet in encoded.packets:
        decoder.push(packet)
    return decoder


@pytest.fixture(scope="module", name="compact")
def _compact() -> EncodedMesh:
    return encode(load_sample("spot"), CompactOptions(bits=BITS, slices=5))


@pytest.mark.parametrize("slices", [1, 5])
def test_diffs_add_up_to_the_positions_in_the_leaf_cells(slices: int) -> None:
    encoded = encode(load_sample("spot"), CompactOptions(bits=BITS, slices=slices))
    told: list[tuple[int, int, int]] = []
    moved = 0.0

    def note(level: int, part: int, differences: Differences) -> Differences:
        nonlocal moved
        told.append((level, part, len(differences)))
        moved += float(differences.sum()) * 2**level
        return differences

    decoder = decoded(encoded, note)
    sent = {(row.level, row.slice) for row in encoded.header.packets if row.kind is PacketKind.DIFF}
    assert {(level, part) for level, part, _ in told} <= sent
    assert decoder.is_exact(0)
    octree = build_octree(encoded.quantized.positions, encoded.quantized.faces, BITS)
    finest = octree.levels[-1]
    sides = 2.0 ** (BITS - finest.cell_depths.astype(float))[:, None]
    centres = finest.cells * sides + sides / 2 - 0.5
    assert moved == pytest.approx(float((encoded.quantized.positions - centres).sum()))


@pytest.mark.parametrize("size", [0.3, 1.0, 1000.0])
def test_no_vertex_leaves_its_leaf_cell(compact: EncodedMesh, size: float) -> None:
    generator = np.random.default_rng(7)

    def perturb(_level: int, _part: int, differences: Differences) -> Differences:
        return differences + size * np.sqrt((differences**2).mean()) * generator.normal(size=differences.shape)

    decoder = decoded(compact, perturb)
    octree = build_octree(compact.quantized.positions, compact.quantized.faces, BITS)
    for level, depth in ((0, BITS), (3, BITS - 3)):
        cells = octree.levels[depth]
        sides = 2.0 ** (BITS - cells.cell_depths.astype(float))[:, None]
        offset = steps(compact, decoder, level) - (cells.cells * sides - 0.5)
        assert (offset > -1e-6).all()
        assert (offset < sides + 1e-6).all()
    assert not decoder.is_exact(0)
    true = decoded(compact)
    assert np.abs(steps(compact, decoder, 0) - steps(compact, true, 0)).max() > 1.0
    np.testing.assert_array_equal(decoder.mesh(0).faces, true.mesh(0).faces)


def test_a_level_above_the_perturbed_one_stays_exact(compact: EncodedMesh) -> None:
    sent = [row.level for row in compact.header.packets if row.kind is PacketKind.DIFF]
    decoder = decoded(compact, lambda level, _part, differences: differences + (level == min(sent)))
    assert not decoder.is_exact(min(sent))
    assert decoder.is_exact(max(sent))
    preview = compact.header.levels[0].level
    assert decoder.is_exact(preview)


def test_classic_diffs_are_perturbed_before_they_are_added() -> None:
    encoded = encode(grid(24), ClassicOptions(bits=10, coarsest_vertices=30))
    decoder = decoded(encoded, lambda level, _part, differences: differences + 0.25 * (level == 0))
    true = decoded(encoded)
    np.testing.assert_allclose(steps(encoded, decoder, 0), steps(encoded, true, 0) + 0.25)
    np.testing.assert_array_equal(decoder.mesh(1).vertices, true.mesh(1).vertices)
    assert decoder.is_exact(1)
    assert not decoder.is_exact(0)
