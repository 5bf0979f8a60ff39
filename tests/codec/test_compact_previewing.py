from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshes import grid, random_meshes
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.compact.previewing import GridPreview, decode_preview, encode_preview
from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import encode
from meshtide_codec.errors import LimitError, MeshtideError, PacketError
from meshtide_codec.limits import Limits
from meshtide_codec.mesh import Mesh
from meshtide_codec.quantize import quantize
from meshtide_codec.stream.packets import PacketKind

if TYPE_CHECKING:
    from collections.abc import Callable


@given(random_meshes(), st.integers(4, 9))
@settings(max_examples=40)
def test_any_preview_comes_back(mesh: Mesh, bits: int) -> None:
    quantized = quantize(mesh, bits)
    preview = GridPreview(bits, quantized.positions, quantized.faces)
    payload = encode_preview(preview)
    decoded = decode_preview(payload, len(preview.cells), 9, Limits())
    assert decoded.bits == bits
    assert np.array_equal(decoded.cells, preview.cells)
    assert np.array_equal(decoded.faces, preview.faces)


def test_corners_of_a_previews_grid_are_those_of_the_meshs() -> None:
    preview = GridPreview(5, np.array([[0, 0, 0], [31, 0, 31]], np.int32), np.zeros((0, 3), np.int32))
    assert preview.drawn(12).tolist() == [[0.0, 0.0, 0.0], [4095.0, 0.0, 4095.0]]


def test_previews_open_the_stream_and_show_the_mesh_better_than_its_first_levels() -> None:
    encoded = encode(grid(64), CompactOptions(previews=(256, 32)))
    rows = encoded.header.levels
    kinds = [entry.kind for entry in encoded.header.packets]
    assert kinds[0] is PacketKind.PREVIEW
    count = kinds.count(PacketKind.PREVIEW)
    assert kinds[count] is PacketKind.BASE
    decoder = Decoder(encoded.header)
    for packet, row in zip(encoded.packets[:count], rows, strict=False):
        updates = decoder.push(packet)
        assert [(update.level, update.exact) for update in updates] == [(row.level, True)]
        assert decoder.best == row.level
        mesh = decoder.mesh(row.level)
        assert (len(mesh.vertices), len(mesh.faces)) == (row.vertices, row.faces)
    assert rows[count].rms > rows[count - 1].rms
    decoder.push(encoded.packets[count])
    assert decoder.best == rows[count - 1].level
    for packet in encoded.packets[count + 1 :]:
        decoder.push(packet)
    assert decoder.best == 0


def test_no_preview_that_says_it_is_the_finest_mesh_is_better_than_a_level() -> None:
    encoded = encode(grid(64), CompactOptions(previews=(256, 32)))
    *coarse, finest = encoded.header.levels
    first = replace(coarse[0], rms=0.0, maximum=0.0)
    decoder = Decoder(replace(encoded.header, levels=(first, *coarse[1:], finest)))
    decoder.push(encoded.packets[0])
    assert decoder.best == first.level
    for packet in encoded.packets[1:]:
        decoder.push(packet)
        assert decoder.best != first.level
    assert decoder.best == 0


def test_levels_without_previews_are_the_same() -> None:
    with_previews = encode(grid(64), CompactOptions(previews=(256, 64)))
    without = encode(grid(64), CompactOptions(previews=()))
    assert len(without.to_bytes()) < len(with_previews.to_bytes())
    assert np.array_equal(with_previews.quantized.positions, without.quantized.positions)
    assert without.packets[0].kind is PacketKind.BASE


def test_claims_are_held_against_the_limits() -> None:
    quantized = quantize(grid(10), 7)
    payload = encode_preview(GridPreview(7, quantized.positions, quantized.faces))
    count = len(quantized.positions)
    with pytest.raises(LimitError):
        decode_preview(payload, count, 7, Limits(faces=5))
    for wrong in (b"", b"\x80", bytes([6]), payload + b"\x01" * 8):
        with pytest.raises(PacketError):
            decode_preview(wrong, count, 7, Limits())
    with pytest.raises(PacketError, match="a preview of 7 bits in a stream of 6"):
        decode_preview(payload, count, 6, Limits())
    for vertices in (1, count - 1, count + 1):
        with pytest.raises(PacketError):
            decode_preview(payload, vertices, 7, Limits())
    assert len(decode_preview(payload, count, 7, Limits()).cells) == count


@given(st.data())
@settings(max_examples=80)
def test_damaged_previews_decode_or_raise_from_the_tree(data: st.DataObject) -> None:
    quantized = quantize(grid(8), 6)
    payload = bytearray(encode_preview(GridPreview(6, quantized.positions, quantized.faces)))
    for _ in range(data.draw(st.integers(1, 3))):
        payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        preview = decode_preview(bytes(payload), len(quantized.positions), 6, Limits(vertices=10_000, faces=10_000))
    except MeshtideError as error:
        assert isinstance(error, PacketError | LimitError)
        return
    assert preview.cells.min() >= 0
    assert preview.cells.max() < 64
    assert preview.faces.size == 0 or preview.faces.max() < len(preview.cells)


def test_a_preview_cut_at_any_byte_or_with_a_flipped_bit_is_survived() -> None:
    quantized = quantize(grid(8), 6)
    count = len(quantized.positions)
    payload = encode_preview(GridPreview(6, quantized.positions, quantized.faces))
    variants = [payload[:end] for end in range(len(payload))]
    variants += [flipped(payload, bit) for bit in range(8 * len(payload))]
    assert refused(variants, lambda variant: decode_preview(variant, count, 6, Limits(faces=10_000))) > len(payload)


def flipped(payload: bytes, bit: int) -> bytes:
    damaged = bytearray(payload)
    damaged[bit // 8] ^= 1 << (bit % 8)
    return bytes(damaged)


def refused(variants: list[bytes], decoded: Callable[[bytes], GridPreview]) -> int:
    """How many variants raise an error of the tree; all others are meshes."""
    count = 0
    for variant in variants:
        try:
            preview = decoded(variant)
        except MeshtideError as error:
            assert isinstance(error, PacketError | LimitError)
            count += 1
        else:
            assert preview.faces.size == 0 or preview.faces.max() < len(preview.cells)
    return count
