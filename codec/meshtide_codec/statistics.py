"""What the Diffs of a level would cost, and how far the predictions were off.

Source: Balan & Taubin 2000, section 4.3: the Shannon bound, the power-law density (20), the rate (21), and
the l2 error per vertex of the tables in section 5. All of it is linear in the number of Diffs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammainc

from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
    from numpy.typing import NDArray

SMALLEST_ALPHA = 0.2
LARGEST_ALPHA = 4.0
BISECTIONS = 50  # halve an interval of width 3.8 to below the resolution of a double


@dataclass(frozen=True)
class PowerLaw:
    """The density alpha a^(1/alpha) / (2 Gamma(1/alpha)) exp(-a |x|^alpha) of eq. (20).

    Args:
        alpha: the exponent, in [0.2, 4] when fitted: 1 is Laplace's distribution, 2 that of Gauss.
        a: the inverse scale, in units of 1 / |x|^alpha; infinite if all values are 0.
    """

    alpha: float
    a: float

    def density(self, x: float) -> float:
        """p(x) for a finite `a`.

        >>> round(PowerLaw(1.0, 2.0).density(0.5), 4)  # exp(-1)
        0.3679
        """
        normalisation: float = self.alpha * self.a ** (1 / self.alpha) / (2 * math.gamma(1 / self.alpha))
        return normalisation * math.exp(-self.a * abs(x) ** self.alpha)


def fit_power_law(differences: NDArray[np.integer] | NDArray[np.floating]) -> PowerLaw:
    """The power law whose ratio of (mean |x|)^2 to mean x^2, and whose mean |x|^alpha, are those of the differences.

    The ratio depends on alpha only, Gamma(2/alpha)^2 / (Gamma(1/alpha) Gamma(3/alpha)), and grows with it;
    alpha is found by bisection in [0.2, 4]. Then a = 1 / (alpha mean |x|^alpha), as in the paper. Moments,
    not likelihood: the likelihood of a density does not bear the many exact zeros of integer Diffs.

    Args:
        differences: any shape, not empty; all coordinates count alike.

    Raises:
        OptionError: there are no differences, or they are not finite numbers.

    >>> law = fit_power_law(np.array([-1.0, 1.0, 2.0, -2.0]))  # flatter than any Gaussian
    >>> law.alpha
    4.0
    >>> fit_power_law(np.zeros(3, np.int32))
    PowerLaw(alpha=1.0, a=inf)
    """
    magnitudes = np.abs(_checked(differences).astype(np.float64)).ravel()
    if len(magnitudes) == 0:
        raise OptionError("a power law cannot be fitted to no differences at all")
    largest = float(magnitudes.max())
    if largest == 0.0:
        return PowerLaw(1.0, math.inf)
    scaled = magnitudes / largest
    ratio = float(scaled.mean()) ** 2 / float((scaled * scaled).mean())
    low, high = SMALLEST_ALPHA, LARGEST_ALPHA
    if ratio <= _moment_ratio(low):
        high = low
    elif ratio >= _moment_ratio(high):
        low = high
    else:
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            if _moment_ratio(middle) < ratio:
                low = middle
            else:
                high = middle
    alpha = (low + high) / 2
    return PowerLaw(alpha, 1 / (alpha * float((magnitudes**alpha).mean())))


def power_law_gap(differences: NDArray[np.integer], law: PowerLaw) -> float:
    """Largest gap between the shares of differences up to k, and what the law gives up to k + 1/2, over all integers k.

    This is Kolmogorov's distance of the two distributions, 0 to 1: how well the hypothesis of section 4.3 holds.

    Args:
        differences: any shape, integers, not empty; all coordinates count alike.
        law: of the differences in steps.

    Raises:
        OptionError: there are no differences, or they are not integers.

    >>> power_law_gap(np.array([-1, 0, 0, 1]), PowerLaw(2.0, 1.0)) < 0.02
    True
    """
    if differences.size == 0 or not np.issubdtype(differences.dtype, np.integer):
        raise OptionError(f"a gap needs integer differences, not {differences.size} of {differences.dtype}")
    if law.a == math.inf:
        return float((differences != 0).mean())
    values, counts = np.unique(differences, return_counts=True)
    ends = np.unique(np.concatenate([values - 1, values]))
    shares = np.concatenate([[0.0], np.cumsum(counts) / differences.size])[np.searchsorted(values, ends, side="right")]
    places = ends + 0.5
    tails = gammainc(1 / law.alpha, law.a * np.abs(places) ** law.alpha)
    return float(np.abs(shares - (0.5 + 0.5 * np.sign(places) * tails)).max())


def rate_model(differences: NDArray[np.integer] | NDArray[np.floating], alpha: float) -> float:
    """Bits per value that eq. (21) predicts, with a estimated from the differences.

    R = r0(alpha) + 1/alpha log2 sum |x|^alpha, r0 = 1 + log2(Gamma(1/alpha) / alpha) + 1/alpha log2(e alpha /
    N): the entropy of the power law at quantization steps of 1. It holds while the differences are wide
    against a step; below that it would fall under 0, where an entropy cannot be, and is cut off.

    Args:
        differences: any shape, in quantization steps.
        alpha: exponent of the power law, more than 0.

    Raises:
        OptionError: alpha is not positive and finite, or the differences are not finite numbers.

    >>> round(rate_model(np.array([-8, 8, 8, -8]), 2.0), 3)  # log2(8 sqrt(2 pi e))
    5.047
    """
    if not 0 < alpha < math.inf:
        raise OptionError(f"alpha {alpha} is not a positive number")
    magnitudes = np.abs(_checked(differences).astype(np.float64))
    total = float((magnitudes**alpha).sum())
    if total == 0.0:
        return 0.0
    width = math.log2(math.e * alpha / magnitudes.size) + math.log2(total)
    log2_gamma = math.lgamma(1 / alpha) / math.log(2)
    return max(0.0, 1 + log2_gamma - math.log2(alpha) + width / alpha)


def shannon_bound_bits(differences: NDArray[np.integer]) -> float:
    """The least bits that an order-0 coder with one model per coordinate can take (section 4.3).

    What it costs to describe the models is not counted.

    Args:
        differences: (n,) or (n, c) integers; each column has its own distribution.

    Raises:
        OptionError: the differences have another shape, or are not integers.

    >>> shannon_bound_bits(np.array([[0, 1], [0, 2], [0, 1], [0, 2]]))
    4.0
    """
    if differences.ndim not in {1, 2} or not np.issubdtype(differences.dtype, np.integer):
        found = f"{differences.shape} of {differences.dtype}"
        raise OptionError(f"differences must be (n,) or (n, c) integers, not {found}")
    if differences.size == 0:
        return 0.0
    columns = differences.reshape(len(differences), -1).T
    bits = 0.0
    for column in columns:
        counts = np.unique(column, return_counts=True)[1]
        bits += float((counts * np.log2(len(column) / counts)).sum())
    return bits


def l2_error_per_vertex(differences: NDArray[np.integer] | NDArray[np.floating], unit: float) -> float:
    """||Diff||_2 / n, the measure of the tables in section 5: it falls with n even where the error does not.

    Args:
        differences: (n,) or (n, 3), in quantization steps.
        unit: length of a step in the unit of the result; 1 / (2^B - 1) for the unit cube.

    Raises:
        OptionError: the differences are not finite numbers.

    >>> l2_error_per_vertex(np.array([[3, 0, 0], [0, 0, 4]]), 0.5)
    1.25
    """
    values = _checked(differences).astype(np.float64)
    if values.size == 0:
        return 0.0
    return math.sqrt(float((values * values).sum())) * unit / len(values)


def _moment_ratio(alpha: float) -> float:
    """(E |x|)^2 / E x^2 of a power law."""
    return math.exp(2 * math.lgamma(2 / alpha) - math.lgamma(1 / alpha) - math.lgamma(3 / alpha))


def _checked(
    differences: NDArray[np.integer] | NDArray[np.floating],
) -> NDArray[np.integer] | NDArray[np.floating]:
    if differences.dtype.kind not in "iuf" or not np.isfinite(differences).all():
        raise OptionError("differences must be finite numbers")
    return differences
