"""Predictors of a level's geometry: polynomial and rational filters in K, applied to the extension.

Source: Balan & Taubin 2000, eqs. (2), (3), (6) to (9), (12), (15), (16). A polynomial of degree d costs d
products with K and three arrays of the size of the mesh; a rational filter adds one conjugate-gradient
solution per coordinate. A prediction is the same bits on every machine: encoder and decoder must agree on it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from meshtide_codec import filters_kernels
from meshtide_codec.errors import ContainerError, MeshError, OptionError, ParamError
from meshtide_codec.graph import Adjacency, apply_k, check_finite_values, check_points

if TYPE_CHECKING:
    from numpy.typing import NDArray

Kind = Literal["zeroth", "gaussian", "taubin", "polynomial", "rational"]
Basis = Literal["power", "chebyshev"]

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
INFINITE_NORM = "inf"  # how the l-infinity norm is written in a header

GRID_INTERVALS = 4096  # where a denominator is evaluated on [0, 2] to bound it
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

    >>> FilterSpec("polynomial", degree=2, norm=math.inf).to_header()
    {'kind': 'polynomial', 'degree': 2, 'basis': 'power', 'norm': 'inf'}
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

    def to_header(self) -> dict[str, str | int | float]:
        """The fields that the kind uses, as plain msgpack types; see the class for an example."""
        header: dict[str, str | int | float] = {"kind": self.kind}
        for name in USED_FIELDS[self.kind]:
            value = getattr(self, name)
            header[name] = INFINITE_NORM if name == "norm" and value == math.inf else value
        return header

    @classmethod
    def from_header(cls, header: object) -> FilterSpec:
        """The filter that `to_header` wrote.

        Raises:
            ContainerError: a field is missing, unknown, of another type or out of range.

        >>> FilterSpec.from_header({"kind": "gaussian"}).degree
        1
        """
        if not isinstance(header, dict):
            raise ContainerError(f"the filter must be a map, not {type(header).__name__}")
        kind = header.get("kind")
        if not isinstance(kind, str) or kind not in USED_FIELDS:
            raise ContainerError(f"filter kind {kind!r} is not one of {', '.join(USED_FIELDS)}")
        if set(header) != {"kind", *USED_FIELDS[kind]}:
            raise ContainerError(f"a {kind} filter has the fields {('kind', *USED_FIELDS[kind])}")
        fields = dict(header)
        if fields.get("norm") == INFINITE_NORM:
            fields["norm"] = math.inf
        try:
            return cls(**fields)
        except OptionError as error:
            raise ContainerError(f"filter in the header: {error}") from error


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
    fill = filters_kernels.power_columns if basis == "power" else filters_kernels.chebyshev_columns
    fill(adjacency.offsets, adjacency.neighbours, columns)
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
    if spec.kind == "zeroth":
        return extension.copy()
    if spec.kind == "gaussian":
        return extension - apply_k(adjacency, extension)
    if spec.kind == "taubin":
        raised = extension + spec.taubin_mu * apply_k(adjacency, extension)
        return raised - spec.taubin_lambda * apply_k(adjacency, raised)
    numerator = np.ascontiguousarray(coefficients[:, : spec.degree + 1], np.float64)
    extension = np.ascontiguousarray(extension)
    filtered = filters_kernels.power_polynomial if spec.basis == "power" else filters_kernels.chebyshev_polynomial
    prediction = filtered(adjacency.offsets, adjacency.neighbours, extension, numerator)
    if spec.kind == "rational":
        for axis in range(3):
            denominator = coefficients[axis, spec.degree + 1 :]
            prediction[:, axis] = divide(adjacency, prediction[:, axis], denominator)
    filters_kernels.restore_isolated(adjacency.offsets, extension, prediction)
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
    if not denominator.any():
        return values
    right_side = np.ascontiguousarray(values)
    solution = np.empty_like(right_side)
    filters_kernels.solve_denominator(
        adjacency.offsets, adjacency.neighbours, denominator.astype(np.float64), right_side, solution
    )
    return solution


def is_safe_denominator(denominator: NDArray[np.float32]) -> bool:
    """Whether 1 + q_1 t + q_2 t^2 + ... is provably positive on [0, 2], and its solution provably quick.

    Its values on a fine grid, less what a Lipschitz constant allows between the points, must stay above
    1/256, and their ratio below 256: then conjugate gradients take less than 256 iterations.

    >>> is_safe_denominator(np.array([2.5], np.float32)), is_safe_denominator(np.array([-0.5], np.float32))
    (True, False)
    """
    if not np.isfinite(denominator).all():
        return False
    coefficients = [float(coefficient) for coefficient in denominator]
    points = np.arange(GRID_INTERVALS + 1) * (2.0 / GRID_INTERVALS)
    values = np.zeros(GRID_INTERVALS + 1)
    for coefficient in reversed([1.0, *coefficients]):
        values = values * points + coefficient
    steepest = sum(power * abs(q) * 2.0 ** (power - 1) for power, q in enumerate(coefficients, start=1))
    slack = steepest / GRID_INTERVALS  # half the distance of two points, times the slope
    lowest, highest = float(values.min()) - slack, float(values.max()) + slack
    return lowest >= SMALLEST_DENOMINATOR and highest <= LARGEST_DENOMINATOR_RATIO * lowest


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
