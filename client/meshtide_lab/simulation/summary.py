"""Means over seeds with their 95 % intervals.

Student's t interval of the mean: exact for normally distributed figures, close for the means of many. Runs that left
nothing to be shown have no figures; they are counted and left out of the means.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import stdtrit

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

CONFIDENCE = 0.95
MEASURES = (
    "l2_per_vertex",
    "l_infinity",
    "vertex_rms",
    "rms",
    "hausdorff",
    "normal_deviation",
    "received_bytes",
    "levels_missing",
)
STREAM_KEYS = ("mesh", "profile", "filter", "S", "slices", "stream")


def mean_interval(values: Sequence[float]) -> tuple[float, float]:
    """The mean, and half the width of its interval: NaN where there are too few values to tell.

    >>> mean, half = mean_interval([1.0, 2.0, 3.0])
    >>> round(mean, 3), round(half, 3)
    (2.0, 2.484)
    """
    found = np.asarray(values, np.float64)
    found = found[np.isfinite(found)]
    if len(found) == 0:
        return math.nan, math.nan
    mean = float(found.mean())
    if len(found) == 1:
        return mean, math.nan
    quantile = float(stdtrit(len(found) - 1, (1 + CONFIDENCE) / 2))
    return mean, quantile * float(found.std(ddof=1)) / math.sqrt(len(found))


def summarize(runs: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row for each stream and link: how many runs, the share of lost Diffs, means and intervals of `MEASURES`."""
    rows = []
    for group in grouped(runs, (*STREAM_KEYS, "loss")):
        shares = [row["lost_diffs"] / row["diffs"] if row["diffs"] else 0.0 for row in group]
        summary = {key: group[0][key] for key in (*STREAM_KEYS, "loss")}
        summary |= {"runs": len(group), "shown": sum(row["level"] >= 0 for row in group)}
        summary |= dict(zip(("lost_share", "lost_share_95"), mean_interval(shares), strict=True))
        for measure in MEASURES:
            mean, half = mean_interval([row[measure] for row in group])
            summary |= {measure: mean, f"{measure}_95": half}
        rows.append(summary)
    return rows


def grouped(rows: Iterable[Mapping[str, Any]], keys: Sequence[str]) -> list[list[Mapping[str, Any]]]:
    """The rows in groups of equal keys, in the order in which groups first appear."""
    groups: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    return list(groups.values())
