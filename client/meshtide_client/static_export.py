"""A folder that any web server can host as it is: `.tide` files, and a list of them where clients look for one.

::

    DIR/meshes/index.json      the list, as GET /meshes of a server answers it
    DIR/meshes/ID.tide         one file a mesh; in subfolders, where ids hold slashes

`http://host/meshes/ID` then works with `fetch`, by ranges where the web server knows them and by one plain download
where it does not, and `http://host` with `meshes`. What is exported into the same folder later is added to the list.
What a server tells of its meshes, such as tags and terms, goes with them.
"""

from __future__ import annotations

import json
import re
import unicodedata
from contextlib import aclosing, closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from meshtide_client.address import ServerAddress
from meshtide_client.arrival import Arrival
from meshtide_client.listing import STATIC_INDEX, HostedMesh, hosted_mesh, list_meshes
from meshtide_client.partial_file import PartialFile
from meshtide_client.tide_address import SUFFIX, parse_address
from meshtide_client.transport import Link
from meshtide_codec.errors import MeshFileError, OptionError
from meshtide_codec.mesh_files import is_mesh_path
from meshtide_codec.output_files import write_atomically
from meshtide_codec.stream import plain_values
from meshtide_codec.stream.container import ContainerReader
from meshtide_codec.stream.session import Until

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_codec.compact.options import CompactOptions
    from meshtide_codec.limits import Limits

COLLECTION = "meshes"
_FOREIGN = re.compile(r"[^a-z0-9_]+")
_LONGEST_ID = 100
_PIECE = 1 << 16


async def export_static(
    sources: Iterable[str],
    folder: Path,
    *,
    options: CompactOptions | ClassicOptions | None = None,
    link: Link | None = None,
    limits: Limits | None = None,
    notify: Callable[[str], None] = lambda _: None,
) -> Sequence[HostedMesh]:
    """Write a static copy of `sources` to `folder`; every packet is verified on the way.

    Args:
        sources: `.tide` files and mesh files (encoded here), folders of them, addresses of servers (all meshes that are
            ready), of meshes, of `.tide` files on web servers and in buckets, and of buckets with a prefix (all below).
        folder: is made if it is missing; what it holds already stays, files of the same id are replaced.
        options: how mesh files are encoded.
        link: timeout, retries and token.
        limits: what a stream may claim.
        notify: is told in one sentence what a person should know.

    Returns:
        All meshes of the folder, in the order of their ids.

    Raises:
        OptionError: a source that is none.
        MeshError: a mesh file that cannot be used.
        StreamError, TransferError, ProtocolError: a stream that is damaged or cannot be had.
        OSError: a file cannot be read or written.
    """
    collection = folder / COLLECTION
    collection.mkdir(parents=True, exist_ok=True)
    link = link or Link()
    found = [item for source in sources for item in _items(source, link, notify)]
    if not found:
        raise OptionError("there is nothing to export: no source holds a .tide file or a mesh")
    told = _earlier(collection)
    taken: set[str] = set()
    for name, item, mesh in found:
        identifier = _unique(_slug_of_path(name), taken)
        taken.add(identifier)
        told.pop(identifier, None)
        if mesh is not None:
            told[identifier] = mesh
        target = collection / f"{identifier}{SUFFIX}"
        target.parent.mkdir(parents=True, exist_ok=True)
        if is_mesh_path(item):
            write_atomically(target, _encoded(Path(item), options))
        else:
            await _copy(item, target, link, limits, notify)
        notify(f"{item}: {target}, {target.stat().st_size} bytes")
    places = {path.relative_to(collection).with_suffix("").as_posix(): path for path in collection.rglob(f"*{SUFFIX}")}
    shown = {identifier: path for identifier, path in places.items() if not re.search(r"(^|/)\.", identifier)}
    meshes = [_row(path, identifier, limits, told.get(identifier)) for identifier, path in shown.items()]
    meshes.sort(key=lambda mesh: mesh.id)
    text = json.dumps([asdict(mesh) for mesh in meshes], indent=1)
    write_atomically(collection / STATIC_INDEX, text.encode())
    return meshes


def _earlier(collection: Path) -> dict[str, HostedMesh]:
    """What the list tells that is there already, by ids; nothing if there is none that can be read."""
    try:
        return {mesh.id: mesh for mesh in map(hosted_mesh, json.loads((collection / STATIC_INDEX).read_bytes()))}
    except (OSError, ValueError, LookupError, TypeError, AttributeError, plain_values.BadValueError):
        return {}  # it is written anew from the files


def _items(source: str, link: Link, notify: Callable[[str], None]) -> Iterable[tuple[str, str, HostedMesh | None]]:
    """Name and place of every mesh that `source` stands for, and what is told of it there."""
    path = Path(source)
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.is_file() and _is_exportable(file))
        return [(file.stem, str(file), None) for file in files]
    if is_mesh_path(source) and "://" not in source:
        return [(path.stem, source, None)]
    if source.startswith("s3://") and not source.endswith(SUFFIX):
        from meshtide_client.s3_source import list_files  # noqa: PLC0415 - an extra

        return [(parse_address(url).mesh, url, None) for url in list_files(source, link.timeout)]
    try:
        return [(parse_address(source).mesh, source, None)]
    except OptionError as error:
        try:
            server = ServerAddress.parse(source)
        except OptionError:
            raise error from None
    hosted = list_meshes(source, timeout=link.timeout, token=link.token)
    for mesh in hosted:
        if mesh.status != "ready":
            notify(f"{mesh.id} is left out: it is {mesh.status}")
    return [(mesh.id, server.mesh(mesh.id).page_url, mesh) for mesh in hosted if mesh.status == "ready"]


def _is_exportable(file: Path) -> bool:
    return not file.name.startswith(".") and (file.suffix.lower() == SUFFIX or is_mesh_path(file))


def _encoded(path: Path, options: CompactOptions | ClassicOptions | None) -> bytes:
    from meshtide_codec.encoder import encode  # noqa: PLC0415 - heavy
    from meshtide_codec.mesh_files import load_mesh  # noqa: PLC0415 - the same

    return encode(load_mesh(path), options).to_bytes()


async def _copy(url: str, target: Path, link: Link, limits: Limits | None, notify: Callable[[str], None]) -> None:
    """Read the whole stream at `url` into `target`, which appears only when all of it is there."""
    partial = target.with_name(f".{target.name}.part")
    with closing(PartialFile(partial, limits=limits, notify=notify, disposable=True)) as holding:
        arrival = Arrival(parse_address(url), holding, until=Until(), link=link, notify=notify, limits=limits)
        async with aclosing(arrival.events()) as events:
            async for _ in events:
                pass  # packets are in the file by now
    partial.replace(target)


def _row(path: Path, identifier: str, limits: Limits | None, told: HostedMesh | None) -> HostedMesh:
    """The line of the list for a file, with what is told of it beside what it holds."""
    reader = ContainerReader(limits)
    with path.open("rb") as file:
        while reader.header is None and (piece := file.read(_PIECE)):
            reader.feed(piece)
    header = reader.header
    if header is None:
        raise MeshFileError(f"{path} is no whole .tide file; delete it and export again")
    own = HostedMesh(
        id=identifier,
        name=path.name,
        status="ready",
        stage=None,
        progress=1.0,
        reason=None,
        vertices=header.vertices,
        faces=header.faces,
        levels=len(header.levels),
        bytes=path.stat().st_size,
    )
    if told is None:
        return own
    return replace(
        own,
        name=told.name,
        tags=told.tags,
        licence=told.licence,
        created=told.created,
        updated=told.updated,
        box=told.box,
        source=told.source,
    )


def _slug_of_path(name: str) -> str:
    """An id that may hold slashes, each part of it a slug."""
    return "/".join(_slug(part) for part in name.split("/") if part) or _slug(name)


def _slug(name: str) -> str:
    """`name` in letters that mean themselves in every URL and file system."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode().lower()
    return _FOREIGN.sub("-", plain).strip("-")[:_LONGEST_ID].rstrip("-") or "mesh"


def _unique(identifier: str, taken: set[str]) -> str:
    number = 2
    candidate = identifier
    while candidate in taken:
        candidate = f"{identifier}-{number}"
        number += 1
    return candidate
