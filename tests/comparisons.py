"""Comparisons made by hand, for tests of what is told of them."""

from __future__ import annotations

from meshtide_codec.report.states import StreamState
from meshtide_lab.comparison.mesh_comparison import FITTED_LADDER, LADDER, MESHTIDE, CodedFile, MeshComparison


def curve(*points: tuple[int, float]) -> list[StreamState]:
    """States of (bytes, RMS), the maximum twice that."""
    return [StreamState(f"state {place}", size, 10, 20, rms, 2 * rms) for place, (size, rms) in enumerate(points)]


def comparison(name: str, *, bits: int = 12, bare: int = 900, draco: int | None = 1000) -> MeshComparison:
    """A mesh of 800 vertices, whose stream takes 100 bytes more with previews."""
    curves = {MESHTIDE: curve((100, 5e-3), (bare // 2, 5e-4), (bare + 100, 0.0))}
    if draco is not None:
        curves[LADDER] = curve((200, 5e-3), (300, 5e-4), (draco + 300, 1e-5))
        curves[FITTED_LADDER] = curve((150, 6e-3), (400, 6e-4), (draco + 400, 1e-5))
    return MeshComparison(
        name=name,
        bits=bits,
        vertices=800,
        faces=1600,
        meshtide=CodedFile(bare + 100, 0.4, 0.04),
        bare_size=bare,
        exact=True,
        draco=None if draco is None else CodedFile(draco, 0.01, 0.001),
        curves=curves,
        problems=[] if draco is not None else ["Draco cannot encode the mesh"],
    )
