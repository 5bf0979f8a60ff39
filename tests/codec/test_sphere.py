from __future__ import annotations

import numpy as np

from meshtide_codec.graph import build_adjacency
from meshtide_codec.sphere import PUBLISHED_MULTI, PUBLISHED_SINGLE, paper_sphere, sphere_table


def test_the_mesh_is_the_papers() -> None:
    sphere = paper_sphere()
    assert (len(sphere.vertices), len(sphere.faces)) == (10242, 20480)
    assert np.allclose(np.linalg.norm(sphere.vertices, axis=1), 1.0)
    corners = sphere.vertices[sphere.faces]
    assert (np.linalg.det(corners) > 0).all()
    degrees = build_adjacency(sphere.faces.astype(np.int32), 10242).degree
    assert np.bincount(degrees).tolist() == [0, 0, 0, 0, 0, 12, 10230]


def test_the_order_of_the_filters_agrees_with_the_paper() -> None:
    rows = {row.name: row for row in sphere_table()}
    assert list(rows) == list(PUBLISHED_MULTI)
    order = ["zeroth", "gaussian", "degree 1", "degree 2", "degree 3", "degree 4", "degree 5"]
    multi = [rows[name].multi for name in order]
    assert multi == sorted(multi, reverse=True)
    single = [rows[name].single for name in PUBLISHED_SINGLE]
    assert single == sorted(single, reverse=True)
    assert all(rows[name].multi < published for name, published in PUBLISHED_MULTI.items())
    errors = [rows[name].l2_error for name in PUBLISHED_SINGLE]
    assert errors == sorted(errors, reverse=True)
