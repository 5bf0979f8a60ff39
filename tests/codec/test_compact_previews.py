"""Previews: how close they are, what they are made of, when there are none, that they never change."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshes import grid, soup
from meshtide_codec.compact.octree import build_octree
from meshtide_codec.compact.previews import DEFAULT_RATIOS, FEWEST_VERTICES, Preview, grid_bits, make_previews
from meshtide_codec.distortion import DistortionMeter
from meshtide_codec.errors import MeshError, OptionError
from meshtide_codec.mesh import Mesh, canonical_faces
from meshtide_codec.quantize import QuantizedMesh, morton_codes, quantize
from meshtide_codec.sphere import paper_sphere

if TYPE_CHECKING:
    from collections.abc import Callable

BITS = 12
NO_FACES = np.zeros((0, 3), np.int32)


def bumpy_sphere() -> Mesh:
    sphere = paper_sphere(5)
    bumps = 1 + 0.1 * np.sin(sphere.vertices * 5).prod(axis=1)
    return Mesh(sphere.vertices * bumps[:, None], sphere.faces)


def box(side: int) -> Mesh:
    """The six faces of a cube, joined along their edges: flat, with sharp edges."""
    u, v = np.meshgrid(np.arange(side + 1), np.arange(side + 1), indexing="ij")
    corner = (u * (side + 1) + v)[:-1, :-1].reshape(-1)
    lower = np.stack([corner, corner + side + 1, corner + 1], axis=1)
    upper = np.stack([corner + 1, corner + side + 1, corner + side + 2], axis=1)
    faces = np.concatenate([lower, upper])
    sheets, triangles = [], []
    for axis in range(3):
        for end in (0, side):
            sheet = np.stack([u.ravel(), v.ravel(), np.full(u.size, end)], axis=1)
            sheets.append(np.roll(sheet, axis, axis=1))
            triangles.append((faces[:, ::-1] if end == 0 else faces) + (len(sheets) - 1) * u.size)
    return Mesh.checked(np.concatenate(sheets), np.concatenate(triangles))


def previews_of(quantized: QuantizedMesh, ratios: tuple[int, ...] = DEFAULT_RATIOS) -> list[Preview]:
    return make_previews(quantized.positions, quantized.faces, quantized.bits, ratios)


def distance(quantized: QuantizedMesh, preview: Preview) -> float:
    meter = DistortionMeter(quantized.positions.astype(float), quantized.faces)
    return meter.measure(preview.vertices(quantized.bits), preview.faces).rms


def check_form(preview: Preview) -> None:
    assert preview.positions.dtype == preview.faces.dtype == np.int32
    build_octree(preview.positions, preview.faces, preview.bits)  # in range, different, in Morton order
    assert (preview.faces == canonical_faces(preview.faces)).all()
    assert (np.unique(preview.faces) == np.arange(len(preview.positions))).all()


def test_a_smooth_surface_is_shown_far_better_than_by_its_octree() -> None:
    quantized = quantize(bumpy_sphere(), BITS)
    previews = previews_of(quantized)
    assert [preview.ratio for preview in previews] == [256, 40]
    assert [len(preview.positions) for preview in previews] == [40, 256]
    octree = build_octree(quantized.positions, quantized.faces, BITS)
    meter = DistortionMeter(quantized.positions.astype(float), quantized.faces)
    for preview in previews:
        check_form(preview)
        level = next(level for level in octree.levels if level.vertex_count >= len(preview.positions))
        middles = level.centres * 2.0 ** (BITS - level.depth - 1) - 0.5
        assert level.faces is not None
        assert distance(quantized, preview) < meter.measure(middles, level.faces).rms / 4
    assert distance(quantized, previews[0]) < 0.012
    assert distance(quantized, previews[1]) < 0.003


def test_flat_faces_and_sharp_edges_take_few_vertices() -> None:
    quantized = quantize(box(24), BITS)
    (preview,) = previews_of(quantized, (100,))
    check_form(preview)
    assert len(preview.positions) <= 36
    assert distance(quantized, preview) < 1e-3


def test_an_open_border_stays_where_it_is() -> None:
    mesh = grid(60)
    quantized = quantize(Mesh(mesh.vertices * [1, 1, 0.5], mesh.faces), BITS)
    (preview,) = previews_of(quantized, (32,))
    check_form(preview)
    reached = preview.vertices(BITS)
    assert (reached.min(axis=0) < [80, 80, 80]).all()
    assert (reached.max(axis=0)[:2] > 4015).all()


def test_the_default_previews_cost_three_percent_at_most_six() -> None:
    assert sum(1 / ratio for ratio in DEFAULT_RATIOS) * 22 / 12 < 0.06


def test_the_same_mesh_has_the_same_previews_on_any_number_of_threads() -> None:
    script = (
        "import sys, hashlib, numpy as np; sys.path[:0] = sys.argv[1:]\n"
        "from test_compact_previews import bumpy_sphere, previews_of, quantize\n"
        "for preview in previews_of(quantize(bumpy_sphere(), 10), (64,)):\n"
        "    print(preview.bits, hashlib.sha256(preview.positions.tobytes() + preview.faces.tobytes()).hexdigest())\n"
    )
    folder = Path(__file__).parent
    digests = set()
    for threads in ("1", "2"):
        environment = os.environ | {
            "OMP_NUM_THREADS": threads,
            "OPENBLAS_NUM_THREADS": threads,
            "NUMBA_NUM_THREADS": threads,
        }
        done = subprocess.run(
            [sys.executable, "-c", script, str(folder), str(folder.parent)],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        digests.add(done.stdout)
    assert len(digests) == 1
    assert len(digests.pop()) > 64


def scattered(count: int) -> Mesh:
    """Many small separate triangles."""
    rng = np.random.default_rng(2)
    vertices = np.repeat(rng.random((count, 3)), 3, axis=0) + 0.01 * rng.random((3 * count, 3))
    return Mesh.checked(vertices, np.arange(3 * count).reshape(-1, 3))


@pytest.mark.parametrize(
    "make",
    [
        lambda: soup(3000, 9000, seed=1),
        lambda: soup(5000, 20, seed=1),
        lambda: scattered(2000),
        lambda: Mesh.checked(np.random.default_rng(1).random((4000, 3)), []),
        lambda: Mesh.checked(np.random.default_rng(3).random((4000, 3)), [[0, i, i + 1] for i in range(1, 3999)]),
        lambda: Mesh.checked(np.random.default_rng(3).random((4000, 3)), [[0, 1, i] for i in range(2, 4000)]),
        lambda: Mesh(grid(60).vertices * [1, 1, 0], grid(60).faces),
        lambda: Mesh(grid(60).vertices * [1, 0, 0], grid(60).faces),
        lambda: Mesh.checked(
            np.concatenate([grid(50).vertices, grid(50).vertices]),
            np.concatenate([grid(50).faces, grid(50).faces + 2500]),
        ),
        lambda: Mesh.checked(grid(50).vertices, np.concatenate([grid(50).faces, grid(50).faces[:, ::-1]])),
    ],
)
def test_any_mesh_has_well_formed_previews_or_none(make: Callable[[], Mesh]) -> None:
    quantized = quantize(make(), BITS)
    for preview in previews_of(quantized, (200, 20)):
        check_form(preview)
        assert len(preview.positions) < len(quantized.positions) / 10


@settings(deadline=None, max_examples=15)
@given(
    st.integers(0, 2**32 - 1), st.integers(2000, 4000), st.integers(1, 9000), st.integers(1, 400), st.integers(7, 20)
)
def test_random_meshes_have_well_formed_previews_or_none(
    seed: int, vertices: int, faces: int, reach: int, bits: int
) -> None:
    rng = np.random.default_rng(seed)
    positions = rng.integers(0, 1 << bits, (vertices, 3)).astype(np.int32)
    positions = positions[np.unique(morton_codes(positions), return_index=True)[1]]
    first = rng.integers(0, len(positions), (faces, 1))
    triangles = ((first + rng.integers(0, reach + 1, (faces, 3))) % len(positions)).astype(np.int32)
    for preview in make_previews(positions, triangles, bits, (256, 32)):
        check_form(preview)


def test_previews_come_coarsest_first_each_ratio_once() -> None:
    quantized = quantize(paper_sphere(4), BITS)
    assert [preview.ratio for preview in previews_of(quantized, (64, 128, 64))] == [128, 64]
    assert previews_of(quantized, ()) == []


def test_small_meshes_and_those_without_faces_have_none() -> None:
    quantized = quantize(grid(44), BITS)
    assert len(quantized.positions) < FEWEST_VERTICES
    assert previews_of(quantized) == []
    assert make_previews(quantize(grid(60), BITS).positions, NO_FACES, BITS) == []
    assert previews_of(quantize(grid(60), BITS), (3000,)) == []


def test_finer_fits_get_finer_grids() -> None:
    depths = [grid_bits(distance, 12) for distance in (200.0, 50.0, 10.0, 2.0, 0.1)]
    assert depths == sorted(depths)
    assert depths[0] == 4
    assert depths[-1] == 12
    assert grid_bits(1.0, 3) == 3


def test_vertices_are_placed_in_the_original_grid() -> None:
    preview = Preview(np.array([[0, 1, 15]], np.int32), NO_FACES, 4, 64)
    assert preview.vertices(8).tolist() == [[0.0, 17.0, 255.0]]


@pytest.mark.parametrize(
    ("positions", "faces", "message"),
    [
        (np.zeros((0, 3), np.int32), NO_FACES, "at least one vertex"),
        (np.zeros((4, 2), np.int32), NO_FACES, "at least one vertex"),
        (np.array([[0, 0, 1 << BITS]], np.int32), NO_FACES, "quantize the mesh"),
        (np.array([[0, 0, -1]], np.int32), NO_FACES, "quantize the mesh"),
        (np.zeros((2, 3), np.int32), np.zeros((1, 4), np.int32), r"\(m, 3\)"),
        (np.zeros((2, 3), np.int32), np.array([[0, 1, 2]], np.int32), "vertices 0..1"),
        (np.zeros((2, 3), np.int32), np.array([[0, 1, -1]], np.int32), "vertices 0..1"),
    ],
)
def test_arrays_that_are_no_mesh_are_refused(
    positions: npt.NDArray[np.int32], faces: npt.NDArray[np.int32], message: str
) -> None:
    with pytest.raises(MeshError, match=message):
        make_previews(positions, faces, BITS)


@pytest.mark.parametrize(("bits", "ratios"), [(0, (64,)), (21, (64,)), (BITS, (1,)), (BITS, (64, 0))])
def test_options_out_of_range_are_refused(bits: int, ratios: tuple[int, ...]) -> None:
    with pytest.raises(OptionError):
        make_previews(np.zeros((1, 3), np.int32), NO_FACES, bits, ratios)
