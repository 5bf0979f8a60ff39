from __future__ import annotations

import pytest

from meshtide_codec.sphere import PUBLISHED_MULTI, PUBLISHED_SINGLE
from meshtide_lab.paper.mesh_result import PICTURED_FILTERS
from meshtide_lab.paper.published import PublishedMesh, published, published_mesh

MESHES = sorted(published().meshes)


@pytest.fixture(params=MESHES)
def mesh(request: pytest.FixtureRequest) -> PublishedMesh:
    return published().meshes[request.param]


def test_the_tables_are_those_of_section_5() -> None:
    numbers = [
        number
        for mesh in published().meshes.values()
        for number in (mesh.multi_table, mesh.degree_table, mesh.single_table)
    ]
    assert numbers == list(range(3, 18))


def test_rates_are_totals_by_vertices(mesh: PublishedMesh) -> None:
    for table in (mesh.multi, mesh.single):
        assert list(table) == list(PICTURED_FILTERS)
        for row in table.values():
            assert 8 * row.total / mesh.vertices == pytest.approx(row.rate, abs=0.03)


def test_totals_are_the_sums_of_their_parts_and_a_little_more(mesh: PublishedMesh) -> None:
    for table in (mesh.multi, mesh.single):
        for row in table.values():
            rest = row.total - row.coarsest - row.coefficients - row.differences
            if table is mesh.single and mesh.name == "sphere":
                rest += row.coefficients * 4 // 7  # printed for seven transitions; the sphere has three
            assert -6 < rest < 35


def test_the_degrees_begin_with_the_rate_of_degree_1(mesh: PublishedMesh) -> None:
    assert len(mesh.degrees) == 7
    assert mesh.degrees[0] == mesh.multi["degree 1"].rate


def test_the_sphere_is_as_the_codec_has_it() -> None:
    sphere = published_mesh("sphere")
    assert sphere is not None
    assert {name: row.rate for name, row in sphere.single.items()} == PUBLISHED_SINGLE
    by_degree = {f"degree {degree}": rate for degree, rate in enumerate(sphere.degrees, start=1)}
    assert {name: row.rate for name, row in sphere.multi.items()} | by_degree == PUBLISHED_MULTI


def test_other_meshes_have_no_figures_of_their_own() -> None:
    assert published_mesh("car") is None  # a file of that name is not the paper's car
