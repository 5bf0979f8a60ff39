"""Perturbed Diffs: what the hook is told, how far vertices move, and that compact ones stay in their leaf cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.packets import PacketKind
from meshtide_codec.samples import load_sample
from meshtide_codec.testing import grid

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Differences = NDArray[np.float64]
    Perturb = Callable[[int, int, Differences], Differences]

BITS = 11


def decoded(encoded: EncodedMesh, perturb: Perturb | None = None) -> Decoder:
    decoder = Decoder(encoded.header, perturb=perturb)
    for packet in encoded.packets:
        decoder.push(packet)
    return decoder


def leaf_cells(positions: NDArray[np.int32], dropped_bits: int) -> tuple[Differences, Differences]:
    """Lowest corners (n, 3) and sides (n, 1), in finest steps, of the cells of a level of profile compact.

    A cell with one finest vertex is not split any more: its depth is that at which the vertex parts from the nearest
    one before or behind it in Morton order.
    """
    changed = np.bitwise_or.reduce(positions[1:] ^ positions[:-1], axis=1)
    parted = np.full(len(positions) + 1, 1 << BITS, np.int64)  # as if others lay outside of the cube
    parted[1:-1] = changed
    nearest = np.minimum(parted[:-1], parted[1:])
    leaf_sides = np.where(nearest < 1 << BITS, 1 << np.log2(np.maximum(nearest, 1)).astype(np.int64), 1 << BITS)
    sides = np.maximum(leaf_sides, 1 << dropped_bits)[:, None]
    lowest, first = np.unique(positions // sides * sides, axis=0, return_index=True)
    order = np.argsort(first)
    return lowest[order] - 0.5, sides[first[order]].astype(np.float64)


@pytest.fixture(scope="module", name="compact")
def _compact() -> EncodedMesh:
    return encode(load_sample("spot"), CompactOptions(bits=BITS, slices=5))


def test_diffs_add_up_to_the_positions_in_the_leaf_cells(compact: EncodedMesh) -> None:
    told: list[tuple[int, int]] = []
    moved = 0.0

    def note(level: int, part: int, differences: Differences) -> Differences:
        nonlocal moved
        told.append((level, part))
        moved += float(differences.sum()) * 2**level
        return differences

    decoder = decoded(compact, note)
    sent = [(row.level, row.slice) for row in compact.header.packets if row.kind is PacketKind.DIFF]
    assert sorted(told) == sorted(sent)
    assert decoder.is_exact(0)
    lowest, sides = leaf_cells(compact.quantized.positions, 0)
    assert moved == pytest.approx(float((compact.quantized.positions - (lowest + sides / 2)).sum()))


@pytest.mark.parametrize("size", [0.3, 1.0, 1000.0])
def test_no_vertex_leaves_its_leaf_cell(compact: EncodedMesh, size: float) -> None:
    generator = np.random.default_rng(7)

    def perturb(_level: int, _part: int, differences: Differences) -> Differences:
        return differences + size * np.sqrt((differences**2).mean()) * generator.normal(size=differences.shape)

    decoder = decoded(compact, perturb)
    for level in (0, 3):
        lowest, sides = leaf_cells(compact.quantized.positions, level)
        offset = decoder.drawn_positions(level) - lowest
        assert (offset >= 0.0).all()
        assert (offset <= sides).all()
    assert not decoder.is_exact(0)
    true = decoded(compact)
    assert np.abs(decoder.drawn_positions(0) - true.drawn_positions(0)).max() > 1.0
    np.testing.assert_array_equal(decoder.mesh(0).faces, true.mesh(0).faces)


def test_a_level_above_the_perturbed_one_stays_exact(compact: EncodedMesh) -> None:
    sent = [row.level for row in compact.header.packets if row.kind is PacketKind.DIFF]
    decoder = decoded(compact, lambda level, _part, differences: differences + (level == min(sent)))
    assert not decoder.is_exact(min(sent))
    assert decoder.is_exact(max(sent))
    preview = compact.header.levels[0].level
    assert decoder.is_exact(preview)


def test_diffs_that_had_to_wait_are_perturbed_when_they_are_decoded(compact: EncodedMesh) -> None:
    told: list[tuple[int, int]] = []

    def note(level: int, part: int, differences: Differences) -> Differences:
        told.append((level, part))
        return differences + 0.125

    late = Decoder(compact.header, perturb=note)
    diffs = [packet for packet in compact.packets if packet.kind is PacketKind.DIFF]
    for packet in diffs[1:]:
        late.push(packet)
    assert not told
    for packet in [*(packet for packet in compact.packets if packet.kind is not PacketKind.DIFF), diffs[0]]:
        late.push(packet)
    assert len(told) == len(diffs)
    in_order = decoded(compact, lambda _level, _part, differences: differences + 0.125)
    np.testing.assert_allclose(late.drawn_positions(0), in_order.drawn_positions(0), atol=1e-9)


def test_classic_diffs_are_perturbed_before_they_are_added() -> None:
    encoded = encode(grid(24), ClassicOptions(bits=10, coarsest_vertices=30))
    decoder = decoded(encoded, lambda level, _part, differences: differences + 0.25 * (level == 0))
    true = decoded(encoded)
    np.testing.assert_array_equal(decoder.drawn_positions(0), true.drawn_positions(0) + 0.25)
    np.testing.assert_array_equal(decoder.drawn_positions(1), true.drawn_positions(1))
    assert decoder.is_exact(1)
    assert not decoder.is_exact(0)
