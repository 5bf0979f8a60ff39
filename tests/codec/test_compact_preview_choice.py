"""The choice of previews: each is within its distance, none where none make sense, nothing sent twice."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from meshes import grid, soup
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.compact.preview_choice import (
    DISTANCES,
    FEW_BITS,
    FINEST_RATIO,
    LARGE,
    LARGE_RATIO,
    LAST_RATIO,
    TOO_SMALL_TO_WAIT,
    choose_previews,
)
from meshtide_codec.compact.previewing import GridPreview, encode_preview
from meshtide_codec.compact.previews import FEWEST_VERTICES, Preview, make_previews
from meshtide_codec.distortion import DistortionMeter
from meshtide_codec.encoder import encode
from meshtide_codec.errors import MeshError, OptionError
from meshtide_codec.mesh import Mesh
from meshtide_codec.quantize import QuantizedMesh, quantize
from meshtide_codec.sphere import paper_sphere
from meshtide_codec.stream.packets import PacketKind


def bumpy_sphere() -> Mesh:
    sphere = paper_sphere(5)
    bumps = 1 + 0.1 * np.sin(sphere.vertices * 5).prod(axis=1)
    return Mesh(sphere.vertices * bumps[:, None], sphere.faces)


def chosen(quantized: QuantizedMesh) -> list[Preview]:
    return choose_previews(quantized.positions, quantized.faces, quantized.bits)


@cache
def bumpy() -> tuple[QuantizedMesh, tuple[Preview, ...]]:
    """The bumpy sphere at 12 bits, and its previews."""
    quantized = quantize(bumpy_sphere(), 12)
    return quantized, tuple(chosen(quantized))


def test_every_distance_is_reached_by_few_vertices() -> None:
    quantized, previews = bumpy()
    meter = DistortionMeter(quantized.positions.astype(float), quantized.faces)
    reached = [meter.measure(preview.vertices(12), preview.faces).rms for preview in previews]
    assert reached == sorted(reached, reverse=True)
    for coarser, distance in zip((1.0, *DISTANCES), DISTANCES[:3], strict=False):
        assert any(distance / 2 < found <= min(distance, coarser) for found in reached)
    assert len(previews[-1].positions) < len(quantized.positions) / 10


def test_the_last_distance_is_reached_if_few_vertices_are_enough() -> None:
    flat = grid(80)
    height = np.abs(flat.vertices[:, :2] - flat.vertices[:, :2].mean(axis=0)).max(axis=1)
    pyramid = quantize(Mesh(np.column_stack([flat.vertices[:, :2], height]), flat.faces), 12)
    previews = chosen(pyramid)
    meter = DistortionMeter(pyramid.positions.astype(float), pyramid.faces)
    assert meter.measure(previews[-1].vertices(12), previews[-1].faces).rms <= DISTANCES[-1]
    assert previews[-1].ratio >= LAST_RATIO
    assert all(preview.ratio >= FINEST_RATIO for preview in bumpy()[1])


def test_the_smallest_of_several_is_taken() -> None:
    """A preview of few bits is not larger than those of one bit more or less that are within its distance."""
    quantized, (first, *_) = bumpy()
    sizes = [
        len(encode_preview(GridPreview(preview.bits, preview.positions, preview.faces)))
        for preview in (first, *make_previews(quantized.positions, quantized.faces, 12, ratios=(first.ratio,)))
    ]
    assert first.bits <= FEW_BITS + 1
    assert sizes[0] <= sizes[-1]


def test_a_preview_that_is_small_has_none_before_it() -> None:
    _, previews = bumpy()
    assert all(len(preview.positions) > TOO_SMALL_TO_WAIT for preview in previews[1:])


def test_large_meshes_spend_little_on_previews() -> None:
    rough = grid(150)
    noise = np.random.default_rng(1).random(len(rough.vertices))
    quantized = quantize(Mesh(rough.vertices + np.array([0, 0, 0.02]) * noise[:, None], rough.faces), 10)
    assert len(quantized.positions) > LARGE
    assert all(preview.ratio >= LARGE_RATIO for preview in chosen(quantized))


def test_meshes_without_use_for_previews_have_none() -> None:
    small = quantize(grid(44), 12)
    assert len(small.positions) < FEWEST_VERTICES
    assert chosen(small) == []
    assert choose_previews(quantize(grid(60), 12).positions, np.zeros((0, 3), np.int32), 12) == []
    assert chosen(quantize(soup(3000, 9000, seed=1), 12)) == []


def test_streams_open_with_them_unless_ratios_are_given() -> None:
    _, previews = bumpy()
    encoded = encode(bumpy_sphere(), CompactOptions(bits=12))
    sent = [packet.payload for packet in encoded.packets if packet.kind is PacketKind.PREVIEW]
    assert sent == [encode_preview(GridPreview(preview.bits, preview.positions, preview.faces)) for preview in previews]
    without = encode(bumpy_sphere(), CompactOptions(bits=10, previews=()))
    assert all(packet.kind is not PacketKind.PREVIEW for packet in without.packets)


def test_what_is_no_mesh_on_a_grid_is_refused() -> None:
    no_faces = np.zeros((0, 3), np.int32)
    with pytest.raises(OptionError, match="depth must be"):
        choose_previews(np.zeros((1, 3), np.int32), no_faces, 21)
    with pytest.raises(MeshError, match="at least one vertex"):
        choose_previews(np.zeros((0, 3), np.int32), no_faces, 12)
