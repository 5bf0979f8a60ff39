"""The report of one stream: bytes by kind, level and layer, and what can be seen after how many bytes.

As tables on the terminal, as a picture, or as one HTML page that holds both. Distances are those of the header.
"""

from __future__ import annotations

import base64
import html
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshtide_codec.errors import OptionError
from meshtide_codec.extras import check_extras
from meshtide_codec.report.layers import HEADER, LAYERS, layer_bytes, totals
from meshtide_codec.report.plots import LIBRARIES, stream_plot
from meshtide_codec.report.states import StreamState
from meshtide_codec.stream.container import PREAMBLE_BYTES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from meshtide_codec.encoder import EncodedMesh
    from meshtide_codec.report.layers import LayerBytes
    from meshtide_codec.stream.header import StreamHeader

TERMINAL = Path("-")
SUFFIXES = (".png", ".html")

_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<style>body {{ font-family: sans-serif; margin: 2em; }} table {{ border-collapse: collapse; margin: 1em 0; }}
td, th {{ padding: 0.2em 0.8em; text-align: right; border-bottom: 1px solid #ccc; }} img {{ max-width: 100%; }}</style>
</head><body><h1>{title}</h1>
{body}
<img alt="Bytes of each level by layer; distance against bytes" src="data:image/png;base64,{picture}">
</body></html>
"""


class StreamReport:
    """What a stream holds.

    Args:
        name: of the mesh.
        encoded: its stream.
        files: where it is written, see `report_files`.
    """

    def __init__(self, name: str, encoded: EncodedMesh, files: Sequence[Path] = ()) -> None:
        self.files = tuple(files)
        header = encoded.header
        self._vertices = header.vertices
        effort = header.options.effort
        how = f"profile {header.profile}, " + (f"effort {effort}, " if effort else "")
        self._title = f"{name}: {how}B = {header.bits}, {header.vertices} vertices"
        self.layers: list[LayerBytes] = layer_bytes(header, encoded.packets)
        self.states = header_states(header)

    def plain(self) -> dict[str, Any]:
        """The layers as plain values that can become JSON; the states stand in the answer of `encode` already."""
        sums = totals(self.layers)
        return {
            "bytes_by_layer": sums,
            "bits_per_vertex_by_layer": {layer: 8 * size / self._vertices for layer, size in sums.items()},
            "share_by_layer": {layer: size / sum(sums.values()) for layer, size in sums.items()},
            "bytes_by_level_and_layer": [
                {"level": row.level, "layer": row.layer, "bytes": row.size} for row in self.layers
            ],
            "report_files": [str(path) for path in self.files],
        }

    def tables(self) -> list[Table]:
        """Bytes by level and layer, and the distances."""
        return [_rich_table(*self._layer_cells()), _rich_table(*self._state_cells())]

    def file(self, path: Path) -> bytes:
        """What the file of that name holds, by its suffix.

        Raises:
            MissingLibraryError: matplotlib is not installed.
        """
        return self.page() if path.suffix.lower() == ".html" else self.picture()

    def picture(self) -> bytes:
        """A PNG file of both.

        Raises:
            MissingLibraryError: matplotlib is not installed.
        """
        return stream_plot(self._title, self.layers, self.states)

    def page(self) -> bytes:
        """An HTML file that needs no other.

        Raises:
            MissingLibraryError: matplotlib is not installed.
        """
        body = "\n".join(_html_table(*cells) for cells in (self._layer_cells(), self._state_cells()))
        picture = base64.b64encode(self.picture()).decode()
        return _PAGE.format(title=html.escape(self._title), body=body, picture=picture).encode()

    def _layer_cells(self) -> tuple[str, list[str], list[list[str]]]:
        sums = totals(self.layers)
        size = sum(sums.values())
        present = [layer for layer in LAYERS if layer in sums]
        rows = []
        for level in dict.fromkeys(row.level for row in self.layers):
            of_level = [row for row in self.layers if row.level == level]
            own = totals(of_level)
            label = HEADER.lower() if level is None else str(level)
            cells = [str(own.get(layer, "")) for layer in present]
            rows.append([label, *cells, *self._rates(sum(own.values()), size)])
        rows += [
            ["bytes", *(str(sums[layer]) for layer in present), str(size), "", ""],
            ["bits/vertex", *(f"{8 * sums[layer] / self._vertices:.3f}" for layer in present), *[""] * 3],
            ["share", *(f"{sums[layer] / size:.1%}" for layer in present), *[""] * 3],
        ]
        return "bytes by level and layer", ["level", *present, "bytes", "bits/vertex", "share"], rows

    def _rates(self, size: int, whole: int) -> list[str]:
        return [str(size), f"{8 * size / self._vertices:.3f}", f"{size / whole:.1%}"]

    def _state_cells(self) -> tuple[str, list[str], list[list[str]]]:
        rows = [
            [
                state.name.removeprefix("level "),
                str(state.vertices),
                str(state.faces),
                str(state.size),
                f"{8 * state.size / self._vertices:.3f}",
                f"{state.rms:.2e}",
                f"{state.maximum:.2e}",
            ]
            for state in self.states
        ]
        columns = ["level", "vertices", "faces", "bytes so far", "bits/vertex", "RMS / diagonal", "maximum / diagonal"]
        return "distance from the quantized mesh, after how many bytes", columns, rows


def header_states(header: StreamHeader) -> list[StreamState]:
    """The states that a header lists, with its distances."""
    before = PREAMBLE_BYTES + len(header.to_bytes())
    return [
        StreamState(
            f"level {row.level}", before + header.level_bytes(row), row.vertices, row.faces, row.rms, row.maximum
        )
        for row in header.levels
    ]


def report_files(target: Path, stem: str) -> list[Path]:
    """The files that `--report target` means; none for the terminal alone.

    Args:
        target: a .png or .html file, a folder for both, or `TERMINAL`.
        stem: name of the mesh, for files in a folder.

    Raises:
        OptionError: a file of another kind.
        MissingLibraryError: matplotlib is not installed.
    """
    if target == TERMINAL:
        return []
    check_extras(*LIBRARIES)
    if target.suffix.lower() in SUFFIXES:
        return [target]
    if target.suffix and not target.is_dir():
        raise OptionError(f"a report is a folder, a {' or '.join(SUFFIXES)} file, or - for the terminal, not {target}")
    return [target / f"{stem}-report{suffix}" for suffix in SUFFIXES]


def _rich_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    from rich import box  # noqa: PLC0415 - only where a table is shown
    from rich.table import Table  # noqa: PLC0415

    table = Table(title=title, box=box.SIMPLE)
    for column in columns:
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(*row)
    return table


def _html_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{html.escape(column)}</th>" for column in columns)
    body = "\n".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<h2>{html.escape(title)}</h2>\n<table><tr>{head}</tr>\n{body}\n</table>"
