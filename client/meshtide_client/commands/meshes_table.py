"""The meshes of a server as a table for people."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from meshtide_codec.printable import printable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from meshtide_client.remote.listing import ListedMesh


def listing_table(meshes: Sequence[ListedMesh]) -> Table:
    """One row a mesh."""
    table = Table()
    table.add_column("mesh")
    table.add_column("state")
    for column in ("vertices", "faces", "levels", "bytes", "bits/vertex"):
        table.add_column(column, justify="right")
    tagged = any(mesh.tags for mesh in meshes)
    if tagged:
        table.add_column("tags")
    for mesh in meshes:
        rate = 8 * mesh.bytes / mesh.vertices if mesh.bytes is not None and mesh.vertices else None
        table.add_row(
            Text(printable(mesh.id)),
            Text(printable(_state(mesh))),
            *("-" if count is None else str(count) for count in (mesh.vertices, mesh.faces, mesh.levels, mesh.bytes)),
            "-" if rate is None else f"{rate:.2f}",
            *([Text(printable(", ".join(mesh.tags)))] if tagged else []),
        )
    return table


def _state(mesh: ListedMesh) -> str:
    if mesh.status == "encoding":
        return f"encoding: {mesh.stage or 'waiting'}, {mesh.progress:.0%}"
    return f"{mesh.status}: {mesh.reason}" if mesh.reason else mesh.status
