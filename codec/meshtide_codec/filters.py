"""Predictors of a level's geometry: polynomial and rational filters in K, applied to the extension.

Source: Balan & Taubin 2000, eqs. (2), (3), (6) to (9), (12), (15), (16). A polynomial of degree d costs d
products with K and three arrays of the size of the mesh; a rational filter adds one conjugate-gradient
solution per coordinate. A prediction is the same bits on every machine: encoder and decoder must agree on it.
"""

from __future__ import annotations

import math
from ctypes import byref
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from meshtide_codec import core
from meshtide_codec.errors import MeshError, OptionError, ParamError
from meshtide_codec.graph import Adjacency, apply_k, check_finite_values, check_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

Kind = Literal["zeroth", "gaussian", "taubin", "polynomial", "rational"]
Basis = Literal["power", "chebyshev"]
KINDS: tuple[Kind, ...] = get_args(Kind)
"""As the core numbers them."""

FIXED_DEGREES = {"zeroth": 0, "gaussian": 1, "taubin": 2}  # filters without fitted coefficients
USED_FIELDS: dict[str, tuple[str, ...]] = {
    "zeroth": (),
    "gaussian": (),
    "taubin": ("taubin_lambda", "taubin_mu"),
    "polynomial": ("degree", "basis", "norm"),
    "rational": ("degree", "basis", "norm", "denominator_degree"),
}
MAXIMUM_DEGREE = 15
MAXIMUM_DENOMINATOR_DEGREE = 4
MAXIMUM_TAUBIN_FACTOR = 2.0

SMALLEST_DENOMINATOR = 1 / 256
LARGEST_DENOMINATOR_RATIO = 256.0  # of its largest to its smallest value: bounds the iterations of a solution


@dataclass(frozen=True)
class FilterSpec:
    """Which filter predicts a level, and how its coefficients are chosen.

    Fields that the kind does not use are set to a fixed value, so filters that act alike compare equal.

    Args:
        kind: ``zeroth`` (the extension itself), ``gaussian`` (1 - K), ``taubin`` ((1 - lambda K)(1 + mu K)),
            ``polynomial`` (eq. 2) or ``rational`` (eq. 3).
        degree: of the polynomial or the numerator, 0 to 15.
        basis: of the polynomial or the numerator: powers of K, or Chebyshev polynomials of K - I.
        norm: p of the l_p norm that the coefficients minimise (eq. 13): in [1, 2] or infinity. 2 for ``rational``.
        taubin_lambda: lambda of ``taubin``, 0 to 2.
        taubin_mu: mu of ``taubin``, 0 to 2.
        denominator_degree: of ``rational``, 1 to 4.

    Raises:
        OptionError: a value of another type or outside of its range.

    >>> FilterSpec("zeroth", degree=7) == FilterSpec("zeroth")
    True
    """

    kind: Kind = "polynomial"
    degree: int = 3
    basis: Basis = "power"
    norm: float = 2.0
    taubin_lambda: float = 0.6307
    taubin_mu: float = 0.6732
    denominator_degree: int = 1

    def __post_init__(self) -> None:
        if not isinstance(self.kind, str) or self.kind not in USED_FIELDS:
            raise OptionError(f"filter kind {self.kind!r} is not one of {', '.join(USED_FIELDS)}")
        self._reset_unused_fields()
        _check_integer("degree", self.degree, 0, MAXIMUM_DEGREE)
        if not isinstance(self.basis, str) or self.basis not in {"power", "chebyshev"}:
            raise OptionError(f"basis {self.basis!r} is not 'power' or 'chebyshev'")
        if self.norm != math.inf:
            object.__setattr__(self, "norm", _checked_number("norm", self.norm, 1.0, 2.0))
        if self.kind == "rational" and self.norm != 2.0:
            raise OptionError("a rational filter is fitted in the l2 norm only; leave norm at 2")
        for name in ("taubin_lambda", "taubin_mu"):
            value = _checked_number(name, getattr(self, name), 0.0, MAXIMUM_TAUBIN_FACTOR)
            object.__setattr__(self, name, value)
        least = 1 if self.kind == "rational" else 0
        _check_integer("denominator_degree", self.denominator_degree, least, MAXIMUM_DENOMINATOR_DEGREE)

    def _reset_unused_fields(self) -> None:
        neutral: dict[str, Any] = {
            "degree": FIXED_DEGREES.get(self.kind, 0),
            "basis": "power",
            "norm": 2.0,
            "taubin_lambda": 0.0,
            "taubin_mu": 0.0,
            "denominator_degree": 0,
        }
        for name, value in neutral.items():
            if name not in USED_FIELDS[self.kind]:
                object.__setattr__(self, name, value)


def coefficient_count(spec: FilterSpec) -> int:
    """How many coefficients per coordinate a Param packet holds for this filter.

    For a rational filter these are the numerator's, then q_1, q_2, ... of the denominator 1 + q_1 K + q_2 K^2 + ...

    >>> coefficient_count(FilterSpec("polynomial", degree=1)), coefficient_count(FilterSpec("taubin"))
    (2, 0)
    """
    return 0 if spec.kind in FIXED_DEGREES else spec.degree + 1 + spec.denominator_degree


def basis_columns(adjacency: Adjacency, values: NDArray[np.float64], degree: int, basis: Basis) -> NDArray[np.float64]:
    """The matrix of eq. (15) or (16): x, K x, ..., K^d x, or x, T_1(K - I) x, ..., T_d(K - I) x.

    Args:
        adjacency: the vertex graph of the fine level.
        values: (n,) float64, one coordinate of the extension.
        degree: d, 0 to 15.
        basis: ``power`` or ``chebyshev``.

    Returns:
        (n, d+1) float64 in Fortran order.

    Raises:
        MeshError: the values have another shape or type, or are not finite.
        OptionError: degree or basis are out of range.
    """
    FilterSpec("polynomial", degree, basis)
    if values.shape != (adjacency.vertex_count,):
        raise MeshError(f"values must be of shape ({adjacency.vertex_count},), not {values.shape}")
    check_finite_values(values, "values")
    columns = np.empty((adjacency.vertex_count, degree + 1), np.float64, order="F")
    columns[:, 0] = values
    for order in range(1, degree + 1):
        column = apply_k(adjacency, columns[:, order - 1])
        if basis == "chebyshev":
            column -= columns[:, order - 1]
            if order > 1:
                column = 2.0 * column - columns[:, order - 2]
        columns[:, order] = column
    return columns


def predict(
    adjacency: Adjacency,
    extension: NDArray[np.float64],
    spec: FilterSpec,
    coefficients: NDArray[np.float32],
) -> NDArray[np.float64]:
    """The filtered extension (eq. 12). An isolated vertex stays where it is.

    The result is finite, but with coefficients from an untrusted stream it may lie anywhere: bound it before
    it becomes integers.

    Args:
        adjacency: the vertex graph of the fine level.
        extension: (n, 3) float64.
        spec: the filter.
        coefficients: (3, coefficient_count(spec)) float32, one row per coordinate.

    Returns:
        (n, 3) float64.

    Raises:
        MeshError: the extension has another shape or type, or is not finite.
        ParamError: the coefficients have another shape or type, are not finite, or give a denominator that is not
            safely positive on [0, 2].

    >>> from meshtide_codec.graph import build_adjacency
    >>> adjacency = build_adjacency(np.array([[0, 1, 2]], np.int32), 3)
    >>> corners = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]])
    >>> predict(adjacency, corners, FilterSpec("gaussian"), np.empty((3, 0), np.float32)).tolist()
    [[1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
    """
    check_points(adjacency, extension, "extension")
    check_coefficients(spec, coefficients)
    filter_of_core = core.Filter(
        KINDS.index(spec.kind),
        spec.basis == "chebyshev",
        spec.degree,
        spec.denominator_degree,
        spec.taubin_lambda,
        spec.taubin_mu,
    )
    prediction = np.empty(extension.shape)
    core.call(
        "mt_graph_predict",
        adjacency.graph,
        byref(filter_of_core),
        np.ascontiguousarray(coefficients),
        np.ascontiguousarray(extension),
        prediction,
    )
    return prediction


def divide(adjacency: Adjacency, values: NDArray[np.float64], denominator: NDArray[np.float32]) -> NDArray[np.float64]:
    """Solve (I + q_1 K + q_2 K^2 + ...) x = values (eq. 5), to a relative residual of 1e-11.

    Args:
        adjacency: the vertex graph.
        values: (n,) float64.
        denominator: (q_1, q_2, ...) float32.

    Raises:
        ParamError: the denominator is not safely positive on [0, 2].
    """
    _check_denominator(denominator)
    solution = np.array(values)
    core.call("mt_graph_divide", adjacency.graph, np.ascontiguousarray(denominator), len(denominator), solution)
    return solution


def is_safe_denominator(denominator: NDArray[np.float32]) -> bool:
    """Whether 1 + q_1 t + q_2 t^2 + ... is provably positive on [0, 2], and its solution provably quick.

    Its values on a fine grid, less what a Lipschitz constant allows between the points, must stay above
    1/256, and their ratio below 256: then conjugate gradients take less than 256 iterations.

    >>> is_safe_denominator(np.array([2.5], np.float32)), is_safe_denominator(np.array([-0.5], np.float32))
    (True, False)
    """
    return bool(core.library().mt_is_safe_denominator(np.ascontiguousarray(denominator), len(denominator)))


def check_coefficients(spec: FilterSpec, coefficients: NDArray[np.float32]) -> None:
    """Raise ParamError unless `coefficients` (3, count) float32 are finite and a filter of `spec` can use them."""
    expected = (3, coefficient_count(spec))
    if coefficients.shape != expected or coefficients.dtype != np.float32:
        found = f"{coefficients.shape} of {coefficients.dtype}"
        raise ParamError(f"a {spec.kind} filter needs coefficients {expected} of float32, not {found}")
    if not np.isfinite(coefficients).all():
        axis, place = np.argwhere(~np.isfinite(coefficients))[0].tolist()
        raise ParamError(f"coefficient {place} of coordinate {axis} is {coefficients[axis, place]}")
    if spec.kind == "rational":
        for denominator in coefficients[:, spec.degree + 1 :]:
            _check_denominator(denominator)


def _check_denominator(denominator: NDArray[np.float32]) -> None:
    if not is_safe_denominator(denominator):
        raise ParamError(
            f"the denominator with coefficients {denominator.tolist()} must lie above {SMALLEST_DENOMINATOR} "
            f"on [0, 2], its values within a ratio of {LARGEST_DENOMINATOR_RATIO}"
        )


def _check_integer(name: str, value: object, least: int, most: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise OptionError(f"{name} {value!r} is not an integer in [{least}, {most}]")


def _checked_number(name: str, value: object, least: float, most: float) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not least <= value <= most:
        raise OptionError(f"{name} {value!r} is not a number in [{least}, {most}]")
    return float(value)
