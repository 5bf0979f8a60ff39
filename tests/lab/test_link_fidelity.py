"""Metrics: known errors, levels that are missing, levels that are exact."""

from __future__ import annotations

import math

import numpy as np
import pytest

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.decoder import Decoder
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.errors import MeshError
from meshtide_codec.mesh import Mesh
from meshtide_codec.packets import PacketKind
from meshtide_codec.testing import grid
from meshtide_lab.link.fidelity import StreamMeter, SurfaceMeter, vertex_errors


@pytest.fixture(scope="module", name="encoded")
def _encoded() -> EncodedMesh:
    return encode(grid(24), ClassicOptions(bits=10, coarsest_vertices=20))


def test_vertex_errors_are_the_papers() -> None:
    true = np.zeros((100, 3))
    found = true.copy()
    found[:, 1] = 0.5
    found[7, 2] = -2.0
    errors = vertex_errors(true, found, unit=2.0)
    l2 = math.sqrt(100 * 0.25 + 4.0) / 2
    assert errors.l2 == pytest.approx(l2)
    assert errors.l2_per_vertex == pytest.approx(l2 / 100)
    assert errors.l_infinity == 1.0
    assert errors.rms == pytest.approx(l2 / math.sqrt(300))


@pytest.mark.parametrize("shape", [(3, 3), (4, 2), (0, 3)])
def test_vertices_that_do_not_correspond_are_refused(shape: tuple[int, int]) -> None:
    with pytest.raises(MeshError, match="compared"):
        vertex_errors(np.zeros((4, 3)) if shape != (0, 3) else np.zeros(shape), np.zeros(shape))


def test_a_tilted_square_has_its_angle() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    square = Mesh.checked(corners, [[0, 1, 2], [0, 2, 3]])
    angle = math.radians(20)
    tilt = np.array([[1, 0, 0], [0, math.cos(angle), math.sin(angle)], [0, -math.sin(angle), math.cos(angle)]])
    meter = SurfaceMeter(square, samples=500)
    tilted = meter.measure(Mesh.checked(corners @ tilt, square.faces))
    assert tilted.normal_deviation == pytest.approx(20.0)
    assert tilted.hausdorff == pytest.approx(math.sin(angle) / math.sqrt(2), rel=1e-6)
    assert meter.measure(square).normal_deviation == pytest.approx(0.0, abs=1e-5)


def test_points_have_no_normals() -> None:
    cloud = Mesh.checked(np.eye(3), [])
    assert math.isnan(SurfaceMeter(cloud, samples=10).measure(cloud).normal_deviation)


def test_a_whole_stream_is_exact(encoded: EncodedMesh) -> None:
    meter = StreamMeter(encoded.header, encoded.packets)
    decoder = Decoder(encoded.header)
    for packet in encoded.packets:
        decoder.push(packet)
    found = meter.measure(decoder)
    assert found.levels_missing == ()
    assert [row.level for row in found.levels] == [row.level for row in encoded.header.levels]
    assert all(row.exact and row.vertex.l2 == 0.0 and row.surface is not None for row in found.levels)
    assert found.final is not None
    assert found.final.surface is not None
    assert found.final.surface.rms < 1e-12
    coarsest = found.levels[0].surface
    assert coarsest is not None
    assert coarsest.rms == pytest.approx(encoded.header.levels[0].rms, rel=0.05)


def test_missing_levels_and_missing_diffs(encoded: EncodedMesh) -> None:
    meter = StreamMeter(encoded.header, encoded.packets)
    decoder = Decoder(encoded.header)
    assert meter.measure(decoder).final is None
    for packet in encoded.packets:
        if (packet.kind, packet.level) not in {(PacketKind.MAP_CONN, 0), (PacketKind.DIFF, 1)}:
            decoder.push(packet)
    found = meter.measure(decoder, surfaces=False)
    assert found.levels_missing == (0,)
    assert found.final is not None
    assert (found.final.level, found.final.exact) == (1, False)
    assert found.final.vertex.l_infinity > 0
    assert found.final.surface is not None
    assert all(row.exact and row.surface is None for row in found.levels[:-1])
