"""What the filters of EXT_meshopt_compression and KHR_meshopt_compression make of decoded attributes.

Format: Khronos, "KHR_meshopt_compression", appendix B. Each filter takes rows of bytes and gives as many back. What the
specification calls unspecified (no such number of bits) becomes some number; nothing is raised.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Bytes = NDArray[np.uint8]
    Floats = NDArray[np.float64]

_SHORT = 32767.0


def octahedral(rows: Bytes) -> Bytes:
    """Unit vectors of two octahedral coordinates and their one; rows of 4 or 8 bytes, the last component as it is."""
    taken = rows.view("<i1" if rows.shape[1] == 4 else "<i2")
    values = taken.astype(np.float64)
    with np.errstate(all="ignore"):
        x, y = values[:, 0] / values[:, 2], values[:, 1] / values[:, 2]
        z = 1 - np.abs(x) - np.abs(y)
        folded = np.minimum(z, 0)
        x, y = x - np.copysign(folded, x), y - np.copysign(folded, y)
        unit = np.stack([x, y, z], axis=1) / np.sqrt(x * x + y * y + z * z)[:, None]
    result = taken.copy()
    result[:, :3] = _rounded(unit * float(np.iinfo(taken.dtype).max), taken.dtype)
    return result.view(np.uint8)


def quaternion(rows: Bytes) -> Bytes:
    """Unit quaternions of their three smaller components; rows of 8 bytes."""
    taken = rows.view("<i2").astype(np.int64)
    three = taken[:, :3] / (taken[:, 3:] | 3) / np.sqrt(2.0)
    largest = np.sqrt(np.maximum(0, 1 - (three * three).sum(axis=1)))
    result = np.empty((len(rows), 4), np.dtype("<i2"))
    places = ((taken[:, 3:] & 3) + np.array([1, 2, 3, 0])) % 4
    whole = _rounded(np.column_stack([three, largest]) * _SHORT, result.dtype)
    np.put_along_axis(result, places, whole, axis=1)
    return result.view(np.uint8)


def exponential(rows: Bytes) -> Bytes:
    """Floats of a mantissa of 24 bits and an exponent of 8; rows of any multiple of 4 bytes."""
    taken = rows.view("<i4")
    with np.errstate(all="ignore"):
        values: NDArray[np.float32] = np.ldexp((taken << 8 >> 8).astype(np.float64), taken >> 24).astype("<f4")
    return values.view(np.uint8)


def color(rows: Bytes) -> Bytes:
    """Colours of YCoCg with an alpha whose highest bit gives the number of bits; rows of 4 or 8 bytes."""
    unsigned = np.dtype("<u1" if rows.shape[1] == 4 else "<u2")
    signed = rows.view("<i1" if rows.shape[1] == 4 else "<i2").astype(np.int64)
    plain = rows.view(unsigned).astype(np.int64)
    alpha = plain[:, 3]
    scale = (1 << np.frexp(np.maximum(alpha, 1))[1].astype(np.int64)) - 1
    y, orange, green = plain[:, 0], signed[:, 1], signed[:, 2]
    alpha &= scale >> 1
    alpha = alpha << 1 | alpha & 1
    whole = np.stack([y + orange - green, y + green, y - orange - green, alpha], axis=1)
    result = _rounded(whole * (np.iinfo(unsigned).max / scale)[:, None], unsigned)
    return result.view(np.uint8)


def _rounded(values: Floats, dtype: np.dtype[Any]) -> NDArray[np.integer[Any]]:
    """Whole numbers, halves away from zero, within the type."""
    bounds = np.iinfo(dtype)
    with np.errstate(all="ignore"):
        whole = np.trunc(np.nan_to_num(values) + np.copysign(0.5, np.nan_to_num(values)))
    return np.clip(whole, bounds.min, bounds.max).astype(dtype)
