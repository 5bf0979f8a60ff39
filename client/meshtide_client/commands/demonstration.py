"""The demonstration: a server with the sample meshes, and a mesh that arrives from it level by level.

Everything is as in real use: the server is a process of its own, the levels come over a websocket, and at the end the
finest one is held against the quantized input, vertex by vertex and face by face.
"""

from __future__ import annotations

import time
from contextlib import nullcontext
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

from meshtide_client.commands.server_process import running_server
from meshtide_client.connection.address import ServerAddress
from meshtide_client.connection.link import Link
from meshtide_client.download.destination import check_levels
from meshtide_client.download.fetch import FetchResult, fetch
from meshtide_client.remote.listing import ListedMesh, list_meshes
from meshtide_codec.errors import MeshtideError, OptionError, TransferError
from meshtide_codec.output_files import made_folder
from meshtide_codec.output_policy import output_file
from meshtide_codec.printable import printable, shown
from meshtide_codec.quantize import quantize
from meshtide_codec.rendering.picture import levels_picture
from meshtide_codec.samples import load_sample, sample_names

if TYPE_CHECKING:
    from pathlib import Path

    from meshtide_client.download.levels import ReceivedLevel
    from meshtide_codec.mesh import Mesh

PICTURE = "levels.png"
_POLL_SECONDS = 0.25
_PATIENCE_SECONDS = 3.0


class MismatchError(MeshtideError):
    """What arrived is not what was encoded: a fault of this program."""


def run_demo(
    folder: Path,
    name: str,
    *,
    rate: float | None = None,
    wait: float = 600.0,
    draw: bool = True,
    overwrite: bool = True,
) -> FetchResult:
    """Show sample `name` arriving level by level; every level is left in `folder` as PLY.

    Args:
        folder: is made if need be.
        name: of the sample.
        rate: bytes a second; None for as fast as it comes.
        wait: seconds to wait for the server and for its encoding.
        draw: whether to leave a picture of all levels too, in levels.png.
        overwrite: whether files that are there already are replaced.

    Raises:
        OptionError: there is no such sample, or the folder holds files of those names that are not to be replaced.
        TransferError: the server did not start, or did not get ready.
        MismatchError: the finest level is not the quantized input.
        OSError: `folder` cannot be written.
    """
    if name not in sample_names():
        raise OptionError(f"there is no sample {name!r}; there are {', '.join(sample_names())}")
    link = Link(rate=rate)
    check_levels(folder, name, overwrite=overwrite)
    picture = output_file(folder / PICTURE, overwrite=overwrite, new_folder=True) if draw else None
    console = Console()
    console.print("starting a server with the sample meshes ...")
    with made_folder(folder), running_server(wait=wait) as url:
        address = ServerAddress.parse(url).mesh(name)
        console.print(f"it listens on {url}")
        _wait_until_ready(console, url, name, wait)
        console.print(f"fetching {address}")
        result, pictured = _fetch(console, str(address), folder, link, overwrite=overwrite)
    _check(result, name)
    console.print(
        f"the finest level is the quantized input (B = {result.header.bits} bits per coordinate), exactly: "
        f"the same {result.figures.vertices} vertices and {result.figures.faces} faces",
        highlight=False,
        soft_wrap=True,
    )
    if picture is not None:
        picture.write(levels_picture(pictured))
    aside = f", side by side in {PICTURE}" if draw else ""
    console.print(f"the levels are in {shown(folder)}{aside}", highlight=False, markup=False, soft_wrap=True)
    return result


def _wait_until_ready(console: Console, url: str, name: str, wait: float) -> None:
    """Poll until the server has encoded the sample; show how far it is."""
    started = time.monotonic()
    explained = False
    columns = (TextColumn("{task.description}", markup=False), BarColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("waiting", total=1.0)
        while True:
            mesh = _find(url, name)
            if mesh.status == "ready":
                return
            if mesh.status == "failed":
                raise TransferError(f"the server could not encode {name}: {mesh.reason}")
            waited = time.monotonic() - started
            if waited > wait:
                raise TransferError(f"{name} was not encoded within {wait:g} seconds; allow more with --wait")
            if waited > _PATIENCE_SECONDS and not explained:
                explained = True
                console.print(f"the server encodes {name} ...", soft_wrap=True)
            stage = printable(f"the server encodes {name}: {mesh.stage}")
            bar.update(task, description=stage, completed=mesh.progress)
            time.sleep(_POLL_SECONDS)


def _find(url: str, name: str) -> ListedMesh:
    for mesh in list_meshes(url):
        if mesh.id == name:
            return mesh
    raise TransferError(f"the server does not host {name}")


def _fetch(
    console: Console, url: str, folder: Path, link: Link, *, overwrite: bool
) -> tuple[FetchResult, list[tuple[str, Mesh]]]:
    """Fetch the mesh, one row of a table a level; also returns a caption and a mesh for each."""
    table = Table(caption="errors as a fraction of the bounding box's diagonal")
    for column in ("level", "bytes", "vertices", "faces", "rms error", "largest error", "seconds"):
        table.add_column(column, justify="right")
    captioned: list[tuple[str, Mesh]] = []

    live = Live(table, console=console, auto_refresh=False, vertical_overflow="visible")
    with live if console.is_terminal else nullcontext():

        def show(level: ReceivedLevel) -> None:
            table.add_row(
                str(level.level),
                str(level.size),
                str(level.vertices),
                str(level.faces),
                f"{level.rms:.4%}" if level.rms or level.level else "exact",
                f"{level.maximum:.4%}" if level.maximum or level.level else "exact",
                f"{level.seconds:.2f}",
            )
            captioned.append((f"level {level.level}: {level.size} bytes, {level.vertices} vertices", level.mesh))
            if console.is_terminal:
                live.refresh()

        def notify(sentence: str) -> None:
            console.print(printable(sentence), markup=False, soft_wrap=True)

        result = fetch(url, keep_levels=folder, link=link, on_level=show, notify=notify, overwrite=overwrite)
    if not console.is_terminal:
        console.print(table)
    return result, captioned


def _check(result: FetchResult, name: str) -> None:
    expected = quantize(load_sample(name), result.header.bits).mesh()
    same = np.array_equal(result.mesh.vertices, expected.vertices) and np.array_equal(result.mesh.faces, expected.faces)
    if not same:
        raise MismatchError(f"the finest level of {name} is not the quantized input; please report this")
