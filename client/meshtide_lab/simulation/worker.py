"""What the processes of a sweep do: encode streams, and send them over links.

A process keeps the last streams that it has measured, each decoded once, so that runs of one stream cost a decoding
and the metrics each.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshtide_codec.encoder import encode
from meshtide_codec.errors import MeshtideError
from meshtide_codec.output_files import write_atomically
from meshtide_codec.packets import PacketKind
from meshtide_codec.stream.container import PREAMBLE_BYTES, read_container
from meshtide_lab.link.fidelity import StreamMeter
from meshtide_lab.link.lossy_link import LossyLink, receive

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshtide_codec.packets import Packet
    from meshtide_codec.stream.header import StreamHeader
    from meshtide_lab.simulation.sources import SweptMesh
    from meshtide_lab.simulation.variants import Variant

STREAMS_KEPT = 4
NOTHING = {"l2": math.nan, "l_infinity": math.nan, "l2_per_vertex": math.nan, "vertex_rms": math.nan}
NO_SURFACE = {"rms": math.nan, "hausdorff": math.nan, "normal_deviation": math.nan}


@dataclass(frozen=True, slots=True)
class Run:
    """One stream over one link with one seed.

    Args:
        number: its place in the sweep.
        loss: the link's models as text.
        seed: of the link.
    """

    number: int
    loss: str
    seed: int


@dataclass(frozen=True, slots=True)
class Batch:
    """Runs of one stream that are done one after the other.

    Args:
        stream: file of the stream.
        runs: the runs.
        unprotected: what the links may lose besides Diffs.
    """

    stream: str
    runs: tuple[Run, ...]
    unprotected: str


def make_stream(source: SweptMesh, variant: Variant, path: str) -> str | None:
    """Encode a mesh into a file; returns what went wrong, or None."""
    try:
        data = source.stream
        if variant.options is not None:
            data = encode(source.mesh().referenced(), variant.options).to_bytes()
        assert data is not None  # noqa: S101 - a source is a mesh or a stream
        read_container(data)
        write_atomically(Path(path), data)
    except (MeshtideError, OSError) as error:
        return str(error)
    return None


def do_batch(batch: Batch) -> list[dict[str, Any]]:
    """The results of a batch's runs: for each its number and either its figures or what went wrong."""
    results = []
    for run in batch.runs:
        try:
            results.append({"run": run.number, **_figures(batch, run)})
        except Exception as error:  # noqa: BLE001 - whatever it is, it is reported in the end, and the sweep goes on
            results.append({"run": run.number, "error": f"{type(error).__name__}: {error}"})
    return results


def _figures(batch: Batch, run: Run) -> dict[str, Any]:
    header, packets, meter = _opened(batch.stream)
    received = receive(LossyLink.parse(run.loss, run.seed, batch.unprotected), header, packets)
    report = received.report
    found = meter.measure(received.decoder)
    diffs = [entry for entry in header.packets if entry.kind is PacketKind.DIFF]
    start = PREAMBLE_BYTES + len(header.to_bytes())
    levels = []
    for row in found.levels:
        surface = NO_SURFACE if row.surface is None else asdict(row.surface)
        vertex = asdict(row.vertex)
        vertex["vertex_rms"] = vertex.pop("rms")
        size = start + header.level_bytes(header.entry(row.level))
        levels.append({"level": row.level, "exact": row.exact, "stream_bytes": size, **vertex, **surface})
    final = dict(levels[-1]) if levels else {"level": -1, "exact": False, **NOTHING, **NO_SURFACE}
    final["stream_bytes"] = start + int(header.packet_offsets[-1])
    figures = {
        **final,
        "received_bytes": start + report.received_bytes,
        "levels_missing": len(found.levels_missing),
        "packets": report.sent,
        "lost_packets": report.lost,
        "diffs": len(diffs),
        "lost_diffs": report.lost_kinds["Diff"],
        "damaged_packets": report.damaged,
        "perturbed_packets": report.perturbed,
        "link_seconds": report.seconds,
    }
    return {"figures": figures, "levels": levels}


@lru_cache(maxsize=STREAMS_KEPT)
def _opened(path: str) -> tuple[StreamHeader, Sequence[Packet], StreamMeter]:
    header, packets = read_container(Path(path).read_bytes())
    return header, packets, StreamMeter(header, packets)
