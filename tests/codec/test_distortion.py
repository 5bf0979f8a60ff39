"""Distortion: known distances, both directions, scale, seeds, odd meshes, refused arguments."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings

from meshtide_codec.distortion import DEFAULT_SAMPLES, DEFAULT_SEED, Distortion, DistortionMeter
from meshtide_codec.errors import MeshError, OptionError
from meshtide_codec.mesh import Mesh
from meshtide_codec.sphere import paper_sphere
from meshtide_codec.testing import grid, random_meshes, shapes

SQUARE = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 4, 0]])
SQUARE_FACES = np.array([[0, 1, 2], [0, 2, 3]])
NO_FACES = np.zeros((0, 3), np.int64)


def distortion(
    original: tuple[npt.NDArray[np.float64], npt.NDArray[np.integer]],
    other: tuple[npt.NDArray[np.float64], npt.NDArray[np.integer]],
    samples: int = DEFAULT_SAMPLES,
    seed: int = DEFAULT_SEED,
) -> Distortion:
    return DistortionMeter(*original, samples=samples, seed=seed).measure(*other)


def arrays(mesh: Mesh) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    return mesh.vertices, mesh.faces


def raised(vertices: npt.NDArray[np.float64], height: float) -> npt.NDArray[np.float64]:
    return vertices + np.array([0.0, 0.0, height])


@pytest.mark.parametrize("name", shapes())
def test_a_mesh_is_no_distance_from_itself(name: str) -> None:
    mesh = arrays(shapes()[name]())
    found = distortion(mesh, mesh)
    assert found.rms < 1e-12
    assert found.maximum < 1e-12


def test_the_worse_direction_counts() -> None:
    half = np.array([[0, 1, 2]])
    found = distortion((SQUARE, SQUARE_FACES), (SQUARE, half), samples=20_000)
    back = distortion((SQUARE, half), (SQUARE, SQUARE_FACES), samples=20_000)
    assert found.maximum == pytest.approx(12 / 5 / 5, abs=1e-12)  # the missing corner's height over the diagonal
    assert found.rms == pytest.approx(math.sqrt(0.5 * 2.4**2 / 6) / 5, rel=0.01)  # of a height over a triangle
    assert back.rms == pytest.approx(found.rms, rel=0.01)


def test_parallel_planes_are_as_far_as_they_are() -> None:
    found = distortion((SQUARE, SQUARE_FACES), (raised(SQUARE, 0.5), SQUARE_FACES))
    assert found.rms == pytest.approx(0.1)
    assert found.maximum == pytest.approx(0.1)


def test_the_maximum_sees_single_vertices() -> None:
    mesh = grid(40)
    spiked = mesh.vertices.copy()
    spiked[20 * 40 + 20, 2] += 30
    found = distortion(arrays(mesh), (spiked, mesh.faces), samples=10)
    assert found.maximum > 25 / mesh.diagonal


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("shift", [0.0, 1e3])
def test_scale_and_place_do_not_matter(scale: float, shift: float) -> None:
    mesh = grid(20)
    other = mesh.vertices + 0.1 * np.random.default_rng(1).normal(size=mesh.vertices.shape)
    plain = distortion(arrays(mesh), (other, mesh.faces))
    moved = distortion(((mesh.vertices + shift) * scale, mesh.faces), ((other + shift) * scale, mesh.faces))
    assert moved.rms == pytest.approx(plain.rms, rel=0.02)
    assert moved.maximum == pytest.approx(plain.maximum, rel=0.02)


def test_the_default_samples_are_good_to_two_percent() -> None:
    fine, coarse = paper_sphere(4), paper_sphere(2)
    exact = distortion(arrays(fine), arrays(coarse), samples=200_000)
    meter = [DistortionMeter(*arrays(fine), seed=seed).measure(*arrays(coarse)).rms for seed in range(5)]
    assert meter == pytest.approx([exact.rms] * 5, rel=0.02)


@settings(deadline=None, max_examples=40)
@given(random_meshes(30), random_meshes(30))
def test_any_two_meshes_have_a_distance_and_always_the_same(original: Mesh, other: Mesh) -> None:
    found = distortion(arrays(original), arrays(other), samples=300, seed=5)
    assert 0 <= found.rms <= found.maximum * (1 + 1e-12)
    assert math.isfinite(found.maximum)
    assert distortion(arrays(original), arrays(other), samples=300, seed=5) == found


def test_the_meter_keeps_its_original() -> None:
    mesh = grid(30)
    meter = DistortionMeter(*arrays(mesh))
    other = raised(mesh.vertices, 0.2)
    first = meter.measure(other, mesh.faces)
    meter.measure(mesh.vertices * 2, mesh.faces)
    assert meter.measure(other, mesh.faces) == first == distortion(arrays(mesh), (other, mesh.faces))


def test_threads_share_a_meter() -> None:
    mesh = grid(50)
    meter = DistortionMeter(*arrays(mesh))
    others = [raised(mesh.vertices, height) for height in (0.1, 0.2, 0.3, 0.4)]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda vertices: meter.measure(vertices, mesh.faces), others))
    assert found == [meter.measure(vertices, mesh.faces) for vertices in others]
    assert [one.rms for one in found] == sorted({one.rms for one in found})


def test_points_are_measured_from_vertex_to_vertex() -> None:
    points = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0]])
    found = distortion((points, NO_FACES), (points[:2], NO_FACES), samples=3000)
    assert found.maximum == pytest.approx(4 / 5)
    assert found.rms == pytest.approx(math.sqrt(16 / 3) / 5)


def test_a_single_point_is_measured_in_its_own_unit() -> None:
    point = np.array([[1.0, 2.0, 3.0]])
    found = distortion((point, NO_FACES), (raised(point, 2.0), NO_FACES))
    assert (found.rms, found.maximum) == pytest.approx((2.0, 2.0))


def test_fewer_vertices_may_be_asked_for() -> None:
    mesh = grid(40)
    spiked = mesh.vertices.copy()
    spiked[20 * 40 + 20, 2] += 30
    meter = DistortionMeter(*arrays(mesh), samples=1, vertex_limit=2)
    assert meter.measure(spiked, mesh.faces).maximum < 0.1


def test_meshes_that_are_none_are_refused() -> None:
    with pytest.raises(MeshError, match="at least one point"):
        DistortionMeter(np.zeros((0, 3)), NO_FACES)
    meter = DistortionMeter(SQUARE, SQUARE_FACES)
    with pytest.raises(MeshError, match="names a vertex"):
        meter.measure(SQUARE, SQUARE_FACES + 1)
    with pytest.raises(MeshError, match="finite"):
        meter.measure(SQUARE * np.nan, SQUARE_FACES)


@pytest.mark.parametrize("options", [{"samples": 0}, {"samples": -5}, {"vertex_limit": 0}])
def test_nothing_to_measure_with_is_refused(options: dict[str, int]) -> None:
    with pytest.raises(OptionError, match="needs samples and vertices"):
        DistortionMeter(SQUARE, SQUARE_FACES, **options)


SQUARE = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 4, 0]])
SQUARE_FACES = np.array([[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize("scale", [1e-307, 1e-300, 1e-160, 1e-100, 1e100, 1e160, 1e300, 1e307])
def test_the_unit_of_the_meshes_does_not_matter(scale: float) -> None:
    original, other = SQUARE * scale, (SQUARE + np.array([0, 0, 0.5])) * scale
    found = distortion((original, SQUARE_FACES), (other, SQUARE_FACES), samples=100)
    assert found.rms == pytest.approx(0.1, rel=1e-9)
    assert found.maximum == pytest.approx(0.1, rel=1e-9)


@pytest.mark.parametrize("ratio", [1e20, 1e70, 1e100, 1e300])
def test_meshes_whose_distance_is_no_number_are_refused(ratio: float) -> None:
    for original, other in ((SQUARE, SQUARE * ratio), (SQUARE / ratio, SQUARE), (SQUARE, SQUARE + ratio)):
        with pytest.raises(MeshError, match=r"cannot be compared: one reaches \d\.\de\+\d+ times the size"):
            distortion((original, SQUARE_FACES), (other, SQUARE_FACES), samples=10)


def test_points_are_compared_in_their_own_unit_or_not_at_all() -> None:
    nothing = np.zeros((0, 3), np.int32)
    point = np.full((1, 3), 1e300)
    assert distortion((point, nothing), (point, nothing)).maximum == 0.0
    for shift in (1e-300, 1e300):
        with pytest.raises(MeshError, match="cannot be compared"):
            distortion((np.zeros((1, 3)), nothing), (np.full((1, 3), shift), nothing))


@pytest.mark.parametrize("ratio", [1e-10, 1e-30, 1e-100, 1e-200, 1e-300, 0.0])
@pytest.mark.parametrize("place", [0.0, 1.0, 1e10])
def test_a_tiny_mesh_is_as_far_away_as_a_point(ratio: float, place: float) -> None:
    found = distortion((SQUARE, SQUARE_FACES), (SQUARE * ratio + place, SQUARE_FACES))
    point = distortion((SQUARE, SQUARE_FACES), (np.full((1, 3), place), np.zeros((0, 3), np.int32)))
    assert found.maximum == pytest.approx(point.maximum, rel=1e-6)
    assert found.rms == pytest.approx(point.rms, rel=1e-6)


def test_a_mesh_without_a_finite_diagonal_is_refused() -> None:
    with pytest.raises(MeshError, match="too large to be measured"):
        distortion((SQUARE * 4e307, SQUARE_FACES), (SQUARE, SQUARE_FACES))
