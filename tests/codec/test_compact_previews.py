"""Previews: how close they are, what they are made of, what is chosen, when there are none, that they never change."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.compact.previews import Preview, choose_previews, make_previews
from meshtide_codec.distortion import DistortionMeter
from meshtide_codec.errors import MeshError, OptionError
from meshtide_codec.mesh import Mesh, canonical_faces
from meshtide_codec.quantize import QuantizedMesh, morton_codes, quantize
from meshtide_codec.sphere import paper_sphere
from meshtide_codec.testing import grid, soup

if TYPE_CHECKING:
    from collections.abc import Callable

BITS = 12
RATIOS = (256, 40)
DISTANCES = (1e-2, 3e-3, 1e-3, 4e-4)  # root mean square, in diagonals, that previews are chosen for
FEWEST_VERTICES = 2000  # of a mesh that has previews
FINEST_RATIO, LARGE_RATIO, LAST_RATIO = 18, 40, 28  # of any mesh, of one of more than 20 000 vertices, the last one's
TOO_SMALL_TO_WAIT = 40  # vertices of a preview that has none before it
NO_FACES = np.zeros((0, 3), np.int32)
TWO = np.array([[0, 0, 0], [0, 0, 1]], np.int32)


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


def previews_of(quantized: QuantizedMesh, ratios: tuple[int, ...] = RATIOS) -> list[Preview]:
    return make_previews(quantized.positions, quantized.faces, quantized.bits, ratios)


def distance(quantized: QuantizedMesh, preview: Preview) -> float:
    meter = DistortionMeter(quantized.positions.astype(float), quantized.faces)
    return meter.measure(preview.vertices(quantized.bits), preview.faces).rms


def chosen(quantized: QuantizedMesh) -> list[Preview]:
    return choose_previews(quantized.positions, quantized.faces, quantized.bits)


@cache
def bumpy() -> tuple[QuantizedMesh, tuple[Preview, ...]]:
    """The bumpy sphere, and the previews that are chosen."""
    quantized = quantize(bumpy_sphere(), BITS)
    return quantized, tuple(chosen(quantized))


def octree_level(quantized: QuantizedMesh, count: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    """Middles of the cells of the first depth that has so many, and their faces."""
    for shift in range(quantized.bits - 1, -1, -1):
        cells, owners = np.unique(quantized.positions >> shift, axis=0, return_inverse=True)
        if len(cells) >= count:
            break
    faces = canonical_faces(owners.reshape(-1)[quantized.faces].astype(np.int32))
    return (cells + 0.5) * 2.0**shift - 0.5, faces


def check_form(preview: Preview) -> None:
    assert preview.positions.dtype == preview.faces.dtype == np.int32
    assert preview.positions.min() >= 0
    assert preview.positions.max() < 1 << preview.bits
    codes = morton_codes(preview.positions)
    assert (codes[1:] > codes[:-1]).all()
    assert (preview.faces == canonical_faces(preview.faces)).all()
    assert (np.unique(preview.faces) == np.arange(len(preview.positions))).all()


def test_a_smooth_surface_is_shown_far_better_than_by_its_octree() -> None:
    quantized = quantize(bumpy_sphere(), BITS)
    previews = previews_of(quantized)
    assert [len(preview.positions) for preview in previews] == [40, 256]
    meter = DistortionMeter(quantized.positions.astype(float), quantized.faces)
    for preview in previews:
        check_form(preview)
        level = octree_level(quantized, len(preview.positions))
        assert distance(quantized, preview) < meter.measure(*level).rms / 4
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


def test_threads_make_the_same_previews() -> None:
    quantized = quantize(bumpy_sphere(), 10)
    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(lambda _: previews_of(quantized, (64, 200)), range(2))
    assert [one.payload for one in first] == [one.payload for one in second]
    assert len(first) == 2
    for one, other in zip(first, second, strict=True):
        assert np.array_equal(one.positions, other.positions)
        assert np.array_equal(one.faces, other.faces)


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
    assert [len(preview.positions) for preview in previews_of(quantized, (64, 128, 64))] == [20, 40]
    assert previews_of(quantized, ()) == []


def test_small_meshes_and_those_without_faces_have_none() -> None:
    quantized = quantize(grid(44), BITS)
    assert len(quantized.positions) < FEWEST_VERTICES
    assert previews_of(quantized) == []
    assert chosen(quantized) == []
    assert make_previews(quantize(grid(60), BITS).positions, NO_FACES, BITS, RATIOS) == []
    assert choose_previews(quantize(grid(60), BITS).positions, NO_FACES, BITS) == []
    assert chosen(quantize(soup(3000, 9000, seed=1), BITS)) == []
    assert previews_of(quantize(grid(60), BITS), (3000,)) == []


def test_every_distance_is_reached_by_few_vertices() -> None:
    quantized, previews = bumpy()
    reached = [distance(quantized, preview) for preview in previews]
    assert reached == sorted(reached, reverse=True)
    for coarser, wanted in zip((1.0, *DISTANCES), DISTANCES[:3], strict=False):
        assert any(wanted / 2 < found <= min(wanted, coarser) for found in reached)
    assert len(previews[-1].positions) < len(quantized.positions) / 10
    for preview in previews:
        check_form(preview)


def test_the_last_distance_is_reached_if_few_vertices_are_enough() -> None:
    flat = grid(80)
    height = np.abs(flat.vertices[:, :2] - flat.vertices[:, :2].mean(axis=0)).max(axis=1)
    pyramid = quantize(Mesh(np.column_stack([flat.vertices[:, :2], height]), flat.faces), BITS)
    previews = chosen(pyramid)
    assert distance(pyramid, previews[-1]) <= DISTANCES[-1]
    assert len(previews[-1].positions) <= len(pyramid.positions) / LAST_RATIO
    sphere, found = bumpy()
    assert all(len(preview.positions) <= len(sphere.positions) / FINEST_RATIO for preview in found)


def test_the_smallest_of_several_is_taken() -> None:
    """A preview of few bits is not larger than those of one bit more or less that are within its distance."""
    quantized, (first, *_) = bumpy()
    ratio = round(len(quantized.positions) / len(first.positions))
    (other,) = previews_of(quantized, (ratio,))
    assert first.bits <= 6
    assert distance(quantized, other) > DISTANCES[0] or len(first.payload) <= len(other.payload)


def test_a_preview_that_is_small_has_none_before_it() -> None:
    _, previews = bumpy()
    assert all(len(preview.positions) > TOO_SMALL_TO_WAIT for preview in previews[1:])


def test_large_meshes_spend_little_on_previews() -> None:
    rough = grid(150)
    noise = np.random.default_rng(1).random(len(rough.vertices))
    quantized = quantize(Mesh(rough.vertices + np.array([0, 0, 0.02]) * noise[:, None], rough.faces), 10)
    previews = chosen(quantized)
    assert len(previews) > 0
    assert all(len(preview.positions) <= len(quantized.positions) / LARGE_RATIO for preview in previews)


def test_payloads_hold_the_previews() -> None:
    for preview in bumpy()[1]:
        leaf_depth = int.from_bytes(preview.payload[:1], "little") - preview.bits * (preview.bits + 1) // 2
        assert 0 < leaf_depth <= preview.bits
        assert 10 < 8 * len(preview.payload) / len(preview.positions) < 40


def test_vertices_are_placed_in_the_original_grid() -> None:
    preview = Preview(np.array([[0, 1, 15]], np.int32), NO_FACES, 4, b"")
    assert preview.vertices(8).tolist() == [[0.0, 17.0, 255.0]]


@pytest.mark.parametrize(
    ("positions", "faces", "message"),
    [
        (np.zeros((0, 3), np.int32), NO_FACES, "at least one vertex"),
        (np.zeros((4, 2), np.int32), NO_FACES, r"\(n, 3\)"),
        (np.array([[0, 0, 1 << BITS]], np.int32), NO_FACES, "quantize the mesh"),
        (np.array([[0, 0, -1]], np.int32), NO_FACES, "quantize the mesh"),
        (np.zeros((2, 3), np.int32), np.zeros((1, 4), np.int32), r"\(n, 3\)"),
        (TWO, np.array([[0, 1, 2]], np.int32), "vertex that is not there"),
        (TWO, np.array([[0, 1, -1]], np.int32), "vertex that is not there"),
        (TWO[::-1], NO_FACES, "in Morton order"),
        (TWO[[0, 0]], NO_FACES, "pairwise different"),
    ],
)
def test_arrays_that_are_no_mesh_are_refused(
    positions: npt.NDArray[np.int32], faces: npt.NDArray[np.int32], message: str
) -> None:
    with pytest.raises(MeshError, match=message):
        make_previews(positions, faces, BITS, RATIOS)
    with pytest.raises(MeshError, match=message):
        choose_previews(positions, faces, BITS)


@pytest.mark.parametrize(("bits", "ratios"), [(0, (64,)), (21, (64,)), (BITS, (1,)), (BITS, (64, 0))])
def test_options_out_of_range_are_refused(bits: int, ratios: tuple[int, ...]) -> None:
    with pytest.raises(OptionError):
        make_previews(np.zeros((1, 3), np.int32), NO_FACES, bits, ratios)


def test_a_depth_out_of_range_is_refused() -> None:
    with pytest.raises(OptionError, match="depth must be"):
        choose_previews(np.zeros((1, 3), np.int32), NO_FACES, 21)
