"""Attributes: tables that fit their mesh, values of elements, parts of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from meshtide_codec.attributes import LOWER_LEFT, NONE, UPPER_LEFT, Attribute, Domain, Kind, origin_of, with_origin
from meshtide_codec.errors import MeshError


def attribute(domain: Domain, values: Any, indices: Any = None) -> Attribute:
    return Attribute("a", Kind.SCALAR, domain, np.asarray(values), None if indices is None else np.asarray(indices))


TABLE = [[1.0, 2], [3, 4], [5, 6], [7, 8]]


@pytest.mark.parametrize(
    ("one", "message"),
    [
        (attribute(Domain.VERTEX, [1.0, 2, 3, 4]), "values must be numbers .k, c., not .4,."),
        (attribute(Domain.VERTEX, [["x"]] * 4), "values must be numbers"),
        (attribute(Domain.VERTEX, TABLE[:3]), "3 values for 4 elements of domain vertex"),
        (attribute(Domain.FACE, TABLE), "4 values for 2 elements of domain face"),
        (attribute(Domain.CORNER, TABLE), "4 values for 6 elements of domain corner"),
        (attribute(Domain.VERTEX, TABLE, [0, 1, 2]), "indices must have shape .4,., not .3,."),
        (attribute(Domain.CORNER, TABLE, [0, 1, 2, 3, 0, 1]), "indices must have shape .2, 3., not .6,."),
        (attribute(Domain.FACE, TABLE, [0, 4]), "an index is outside of its 4 values"),
        (attribute(Domain.FACE, TABLE, [0, -2]), "an index is outside of its 4 values"),
        (attribute(Domain.FACE, TABLE[:0], [0, NONE]), "values must be numbers|outside of its 0 values"),
        (attribute(Domain.FACE, TABLE, [0.0, 1.0]), "indices must be integers, not float64"),
    ],
)
def test_tables_that_do_not_fit_are_refused(one: Attribute, message: str) -> None:
    with pytest.raises(MeshError, match=f"attribute 'a': .*{message}"):
        one.check(4, 2)


@pytest.mark.parametrize(
    "one",
    [
        attribute(Domain.VERTEX, TABLE),
        attribute(Domain.FACE, TABLE, [3, NONE]),
        attribute(Domain.CORNER, TABLE, [[0, 1, 2], [3, NONE, 0]]),
        attribute(Domain.CORNER, [[1]] * 6),
        attribute(Domain.FACE, np.zeros((0, 2)), [NONE, NONE]),
        attribute(Domain.FACE, np.zeros((2, 0), np.uint8)),
    ],
)
def test_tables_that_fit_pass(one: Attribute) -> None:
    one.check(4, 2)


def test_an_empty_mesh_has_empty_attributes() -> None:
    for domain in Domain:
        one = attribute(domain, np.zeros((0, 3)))
        one.check(0, 0)
        assert one.per_element().shape == (0, 3)
        assert one.rows().shape == (0,)


def test_each_element_has_its_value_or_zeros() -> None:
    plain = attribute(Domain.VERTEX, TABLE)
    assert plain.rows().tolist() == [0, 1, 2, 3]
    assert plain.per_element().tolist() == TABLE
    shared = attribute(Domain.CORNER, TABLE, [[3, 3, NONE], [0, 1, NONE]])
    assert shared.rows().tolist() == [3, 3, NONE, 0, 1, NONE]
    assert shared.per_element().tolist() == [[7, 8], [7, 8], [0, 0], [1, 2], [3, 4], [0, 0]]
    assert attribute(Domain.FACE, np.zeros((0, 2), np.uint8), [NONE]).per_element().tolist() == [[0, 0]]
    assert TABLE[3] == [7, 8]


@pytest.mark.parametrize("kept", [np.array([True, False, True]), np.array([0, 2])])
def test_parts_have_the_values_of_their_elements(kept: np.ndarray) -> None:
    numbers = np.arange(9)[:, None]
    flat = attribute(Domain.CORNER, numbers).of_elements(kept)
    assert flat.values.reshape(-1).tolist() == [0, 1, 2, 6, 7, 8]
    shared = attribute(Domain.CORNER, numbers, np.arange(9).reshape(3, 3)[::-1]).of_elements(kept)
    assert shared.per_element().reshape(-1).tolist() == [6, 7, 8, 0, 1, 2]
    for domain in (Domain.FACE, Domain.VERTEX):
        assert attribute(domain, numbers[:3]).of_elements(kept).values.tolist() == [[0], [2]]
        assert attribute(domain, numbers, [8, NONE, 4]).of_elements(kept).per_element().tolist() == [[8], [4]]


def test_what_else_is_told_stays_with_a_part() -> None:
    one = Attribute("l", Kind.LABEL, Domain.FACE, np.zeros((2, 1), np.uint8), None, True, 5, {"names": ("a",)})
    part = one.of_elements(np.array([1]))
    assert (part.name, part.kind, part.normalized, part.bits, part.extra) == (
        "l",
        Kind.LABEL,
        True,
        5,
        {"names": ("a",)},
    )


def texcoord(values: Any, kind: str, *, normalized: bool = False) -> Attribute:
    array = np.array(values, kind)
    return Attribute("uv", Kind.TEXCOORD, Domain.VERTEX, array, normalized=normalized, extra={"names": ["a"]})


@pytest.mark.parametrize(
    ("one", "values", "kind", "normalized"),
    [
        (texcoord([[0.25, 0.75], [2, -1]], "f8"), [[0.25, 0.25], [2, 2]], "f8", False),
        (texcoord([[0.25, 0.75]], "f4"), [[0.25, 0.25]], "f4", False),
        (texcoord([[0.25, 2.0**-30]], "f4"), [[0.25, 1 - 2.0**-30]], "f8", False),
        (texcoord([[0, 255], [7, 1]], "u1", normalized=True), [[0, 0], [7, 254]], "u1", True),
        (texcoord([[0, 65535]], "u2", normalized=True), [[0, 0]], "u2", True),
        (texcoord([[127, -127], [0, -128]], "i1", normalized=True), [[1, 2], [0, 2]], "f8", False),
        (texcoord([[5, 3]], "u1"), [[5, -2]], "f8", False),
        (texcoord([[0.5, 0.25, 3]], "f8"), [[0.5, 0.75, 3]], "f8", False),
        (texcoord([[0.5]], "f8"), [[0.5]], "f8", False),
    ],
)
def test_texture_coordinates_count_from_either_corner(one: Attribute, values: Any, kind: str, normalized: bool) -> None:
    assert origin_of(one) == LOWER_LEFT
    assert with_origin(one, LOWER_LEFT) is one
    found = with_origin(one, UPPER_LEFT)
    assert found.values.tolist() == values
    assert (found.values.dtype, found.normalized) == (np.dtype(kind), normalized)
    assert found.extra == {"names": ["a"], "origin": UPPER_LEFT}
    again = with_origin(found, LOWER_LEFT)
    assert again.extra == {"names": ["a"]}
    if kind == one.values.dtype.str[1:]:
        assert again.values.tolist() == one.values.tolist()
