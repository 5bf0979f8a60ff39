"""Many meshes in a few numbers: geometric mean and worst ratio, what previews cost, bytes for each distance."""

from __future__ import annotations

import math
import statistics
from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshtide_codec.report.states import TARGETS, bytes_for
from meshtide_lab.comparison.mesh_comparison import FITTED_LADDER, LADDER, MESHTIDE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from meshtide_lab.comparison.mesh_comparison import MeshComparison


BETTER_LADDER = "better ladder"
LADDERS = (LADDER, BETTER_LADDER)
"""The ladder of equal steps, and for each mesh and distance the better of that and the one of fitted steps."""


@dataclass(frozen=True, slots=True)
class TargetSummary:
    """How meshtide's bytes for one distance compare with a ladder's, over the meshes that have one.

    Args:
        target: RMS distance, as a fraction of the diagonal.
        ladder: which ladder, one of `LADDERS`.
        ratio: geometric mean of meshtide's bytes against the ladder's.
        worst: the largest of these ratios.
        fewer: meshes for which meshtide needs fewer bytes.
        meshes: of so many.
    """

    target: float
    ladder: str
    ratio: float
    worst: float
    fewer: int
    meshes: int


@dataclass(frozen=True, slots=True)
class Summary:
    """All meshes at one quantization; ratios are None if Draco could not take any of them.

    Args:
        bits: B.
        meshes: how many were compared.
        ratio: geometric mean of file sizes without previews against Draco's.
        worst: the largest of these ratios.
        worst_mesh: whose it is.
        ratio_with_previews: geometric mean of whole streams, previews included, against Draco's files.
        preview_bits_per_vertex: mean over the meshes; 0 for a profile that has no previews.
        encode_speed: geometric mean of the input's vertices per second of processor time.
        decode_speed: the same for decoding.
        draco_encode_speed: Draco's, in the same process.
        draco_decode_speed: Draco's, in the same process.
        targets: bytes for each distance against each ladder's.
    """

    bits: int
    meshes: int
    ratio: float | None
    worst: float | None
    worst_mesh: str | None
    ratio_with_previews: float | None
    preview_bits_per_vertex: float
    encode_speed: float
    decode_speed: float
    draco_encode_speed: float | None
    draco_decode_speed: float | None
    targets: tuple[TargetSummary, ...]


def summarize(comparisons: Sequence[MeshComparison]) -> list[Summary]:
    """A summary for each quantization, in the order in which they first come."""
    by_bits: dict[int, list[MeshComparison]] = {}
    for comparison in comparisons:
        by_bits.setdefault(comparison.bits, []).append(comparison)
    return [_summary(bits, group) for bits, group in by_bits.items()]


def ladder_bytes(comparison: MeshComparison, target: float, ladder: str = BETTER_LADDER) -> int | None:
    """Bytes after which a ladder, one of `LADDERS`, is within `target`; None if it never is."""
    names = (LADDER,) if ladder == LADDER else (LADDER, FITTED_LADDER)
    found = (bytes_for(comparison.curves.get(name, []), target) for name in names)
    return min((size for size in found if size is not None), default=None)


def _summary(bits: int, group: Sequence[MeshComparison]) -> Summary:
    compared = [(item, item.ratio) for item in group if item.ratio is not None]
    worst = max(compared, key=lambda pair: pair[1], default=(None, None))
    previews = [item.bits_per_vertex(item.meshtide.size - item.whole_size) for item in group]
    drawn = [(item.vertices, item.draco) for item in group if item.draco is not None]
    return Summary(
        bits=bits,
        meshes=len(group),
        ratio=_geometric_mean(ratio for _, ratio in compared),
        worst=worst[1],
        worst_mesh=None if worst[0] is None else worst[0].name,
        ratio_with_previews=_geometric_mean(
            item.ratio_with_previews for item in group if item.ratio_with_previews is not None
        ),
        preview_bits_per_vertex=statistics.fmean(previews),
        encode_speed=_geometric_mean(_speed(item.vertices, item.meshtide.encode_seconds) for item in group) or 0.0,
        decode_speed=_geometric_mean(_speed(item.vertices, item.meshtide.decode_seconds) for item in group) or 0.0,
        draco_encode_speed=_geometric_mean(_speed(vertices, file.encode_seconds) for vertices, file in drawn),
        draco_decode_speed=_geometric_mean(_speed(vertices, file.decode_seconds) for vertices, file in drawn),
        targets=tuple(
            summary
            for target in TARGETS
            for ladder in LADDERS
            if (summary := _target_summary(group, target, ladder)) is not None
        ),
    )


def _target_summary(group: Sequence[MeshComparison], target: float, ladder: str) -> TargetSummary | None:
    pairs = ((bytes_for(item.curves[MESHTIDE], target), ladder_bytes(item, target, ladder)) for item in group)
    ratios = [ours / theirs for ours, theirs in pairs if ours is not None and theirs is not None]
    mean = _geometric_mean(ratios)
    if mean is None:
        return None
    return TargetSummary(target, ladder, mean, max(ratios), sum(ratio < 1 for ratio in ratios), len(ratios))


def _speed(vertices: int, seconds: float) -> float:
    return vertices / max(seconds, 1e-6)  # a clock that ticks slowly may see no time at all


def _geometric_mean(values: Iterable[float]) -> float | None:
    logarithms = [math.log(value) for value in values]
    return math.exp(statistics.fmean(logarithms)) if logarithms else None
