"""The figures of a comparison as tables: for people (rich), for spreadsheets (CSV), for programs (plain values)."""

from __future__ import annotations

import csv
import io
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from meshtide_codec.printable import shown
from meshtide_codec.report.states import TARGETS, bytes_for
from meshtide_lab.comparison.mesh_comparison import FITTED_LADDER, LADDER, MESHTIDE
from meshtide_lab.comparison.summary import LADDERS, summarize

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from rich.table import Table

    from meshtide_lab.comparison.mesh_comparison import CodedFile, MeshComparison
    from meshtide_lab.comparison.summary import Summary

Row = dict[str, Any]
NOTHING = "-"


def size_rows(comparisons: Iterable[MeshComparison]) -> list[Row]:
    """One row a mesh and quantization: sizes, ratios and times."""
    return [
        {
            "mesh": item.name,
            "bits": item.bits,
            "vertices": item.vertices,
            "faces": item.faces,
            "meshtide_bytes": item.meshtide.size,
            "meshtide_bytes_without_previews": item.whole_size,
            "draco_bytes": _of(item.draco, "size"),
            "meshtide_bits_per_vertex": item.bits_per_vertex(item.meshtide.size),
            "meshtide_bits_per_vertex_without_previews": item.bits_per_vertex(item.whole_size),
            "draco_bits_per_vertex": None if item.draco is None else item.bits_per_vertex(item.draco.size),
            "ratio_without_previews": item.ratio,
            "ratio": item.ratio_with_previews,
            "meshtide_encode_seconds": item.meshtide.encode_seconds,
            "draco_encode_seconds": _of(item.draco, "encode_seconds"),
            "meshtide_decode_seconds": item.meshtide.decode_seconds,
            "draco_decode_seconds": _of(item.draco, "decode_seconds"),
            "exact": item.exact,
            "problems": "; ".join(item.problems),
        }
        for item in comparisons
    ]


def target_rows(comparisons: Iterable[MeshComparison]) -> list[Row]:
    """One row a mesh, quantization and distance: bytes of the first state that is so close, for each candidate."""
    return [
        {"mesh": item.name, "bits": item.bits, "rms": target}
        | {
            f"{name}_bytes": bytes_for(item.curves.get(curve, []), target)
            for name, curve in (("meshtide", MESHTIDE), ("ladder", LADDER), ("fitted_ladder", FITTED_LADDER))
        }
        for item in comparisons
        for target in TARGETS
    ]


def state_rows(comparisons: Iterable[MeshComparison]) -> list[Row]:
    """One row a state of each candidate."""
    return [
        {"mesh": item.name, "bits": item.bits, "candidate": candidate} | asdict(state)
        for item in comparisons
        for candidate, states in item.curves.items()
        for state in states
    ]


def plain_comparison(comparisons: Sequence[MeshComparison]) -> dict[str, Any]:
    """All figures as plain values that can become JSON."""
    return {
        "summaries": [asdict(summary) for summary in summarize(comparisons)],
        "meshes": size_rows(comparisons),
        "targets": target_rows(comparisons),
        "states": state_rows(comparisons),
    }


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows that share their columns, as CSV with a line of names.

    >>> csv_text([{"mesh": "spot", "bytes": 3}, {"mesh": "cow, brown", "bytes": None}]).splitlines()
    ['mesh,bytes', 'spot,3', '"cow, brown",']
    """
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def size_table(comparisons: Iterable[MeshComparison]) -> Table:
    """Bits per vertex, ratios and times of each mesh."""
    from rich.text import Text  # noqa: PLC0415 - only where a table is shown

    table = _table(
        "whole files, bits per vertex of the input; milliseconds of processor time",
        ["mesh"],
        ["B", "vertices", "meshtide", "+ previews", "Draco", "ratio", "with previews"],
        ["encode", "Draco", "decode", "Draco", "exact"],
    )
    for item in comparisons:
        draco = item.draco
        table.add_row(
            Text(shown(item.name)),
            str(item.bits),
            str(item.vertices),
            f"{item.bits_per_vertex(item.whole_size):.2f}",
            f"{item.bits_per_vertex(item.meshtide.size - item.whole_size):.2f}",
            NOTHING if draco is None else f"{item.bits_per_vertex(draco.size):.2f}",
            _figure(item.ratio),
            _figure(item.ratio_with_previews),
            f"{1e3 * item.meshtide.encode_seconds:.0f}",
            NOTHING if draco is None else f"{1e3 * draco.encode_seconds:.0f}",
            f"{1e3 * item.meshtide.decode_seconds:.0f}",
            NOTHING if draco is None else f"{1e3 * draco.decode_seconds:.1f}",
            "yes" if item.exact else "NO",
        )
    return table


def target_table(comparisons: Iterable[MeshComparison]) -> Table:
    """Bytes for each distance: meshtide's, the ladder's, and its with steps fitted to each level."""
    from rich.text import Text  # noqa: PLC0415 - only where a table is shown

    table = _table(
        "bytes of the first state whose RMS distance is at most ... of the diagonal: meshtide/ladder/fitted steps",
        ["mesh"],
        ["B", *(f"{target:.1e}" for target in TARGETS)],
    )
    for item in comparisons:
        cells = []
        for target in TARGETS:
            sizes = [bytes_for(item.curves.get(name, []), target) for name in (MESHTIDE, LADDER, FITTED_LADDER)]
            cells.append("/".join(NOTHING if size is None else str(size) for size in sizes))
        table.add_row(Text(shown(item.name)), str(item.bits), *cells)
    return table


def summary_table(summaries: Sequence[Summary]) -> Table:
    """One column a quantization."""
    from rich.text import Text  # noqa: PLC0415 - only where a table is shown

    table = _table("summary", ["figure"], [f"B = {summary.bits}" for summary in summaries])
    rows = {
        "meshes": [str(item.meshes) for item in summaries],
        "file without previews / Draco, geometric mean": [_figure(item.ratio) for item in summaries],
        "the worst mesh": [f"{_figure(item.worst)} ({shown(item.worst_mesh or 'none')})" for item in summaries],
        "stream with previews / Draco, geometric mean": [_figure(item.ratio_with_previews) for item in summaries],
        "previews, bits per vertex": [f"{item.preview_bits_per_vertex:.2f}" for item in summaries],
        "encode, vertices/s": [_rounded(item.encode_speed) for item in summaries],
        "Draco": [_rounded(item.draco_encode_speed) for item in summaries],
        "decode, vertices/s": [_rounded(item.decode_speed) for item in summaries],
        "Draco ": [_rounded(item.draco_decode_speed) for item in summaries],
    }
    for name, cells in rows.items():
        table.add_row(name, *map(Text, cells))
    return table


def target_summary_table(summaries: Iterable[Summary]) -> Table:
    """Bytes for each distance against the ladder's, over all meshes."""
    table = _table(
        "meshtide's bytes for an RMS distance / those of the ladder, and of the better of both ladders",
        [],
        ["B", "RMS"],
        *([ladder, "worst", "fewer bytes in"] for ladder in LADDERS),
    )
    for summary in summaries:
        for target in TARGETS:
            cells = []
            for ladder in LADDERS:
                found = next((row for row in summary.targets if (row.target, row.ladder) == (target, ladder)), None)
                cells += (
                    [NOTHING] * 3
                    if found is None
                    else [f"{found.ratio:.2f}", f"{found.worst:.2f}", f"{found.fewer} of {found.meshes}"]
                )
            table.add_row(str(summary.bits), f"{target:.1e}", *cells)
    return table


def _table(title: str, left: Sequence[str], *right: Sequence[str]) -> Table:
    from rich import box  # noqa: PLC0415 - only where a table is shown
    from rich.table import Table  # noqa: PLC0415

    table = Table(title=title, box=box.SIMPLE, padding=(0, 1))
    for column in left:
        table.add_column(column, no_wrap=True)
    for columns in right:
        for column in columns:
            table.add_column(column, justify="right", overflow="fold")
    return table


def _of(file: CodedFile | None, name: str) -> float | None:
    return None if file is None else getattr(file, name)


def _figure(value: float | None) -> str:
    return NOTHING if value is None else f"{value:.3f}"


def _rounded(value: float | None) -> str:
    return NOTHING if value is None else f"{float(f'{value:.3g}'):,.0f}"
