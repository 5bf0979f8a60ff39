"""A folder that any web server can host as it is: `.tide` files, and a list of them where clients look for one.

::

    DIR/meshes/index.json      the list, as GET /meshes of a server answers it
    DIR/meshes/ID.tide         one file a mesh; in subfolders, where ids hold slashes

`http://host/meshes/ID` then works with `fetch`, by ranges where the web server knows them and by one plain download
where it does not, and `http://host` with `meshes`. What is exported into the same folder later is added to the list.
What a server says of its meshes, such as tags and licence, goes with them.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import unicodedata
from contextlib import ExitStack, aclosing, closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from meshtide_client.connection.address import ServerAddress
from meshtide_client.connection.link import Link
from meshtide_client.connection.secrecy import shown_address
from meshtide_client.connection.tide_address import SUFFIX, parse_address
from meshtide_client.download.attempts import Attempts
from meshtide_client.download.partial_file import PartialFile
from meshtide_client.remote.folder_search import oddity
from meshtide_client.remote.listing import STATIC_INDEX, ListedMesh, hosted_mesh, list_meshes
from meshtide_codec.command_line import explanation
from meshtide_codec.errors import ContainerError, MeshtideError, OptionError
from meshtide_codec.file_suffix import split_name
from meshtide_codec.json_text import json_text
from meshtide_codec.mesh_files import is_mesh_path
from meshtide_codec.output_files import made_folder, move_into_place
from meshtide_codec.output_policy import check_different, output_file, output_folder
from meshtide_codec.printable import listed_name, shown
from meshtide_codec.stream import plain_values
from meshtide_codec.stream.container import ContainerReader
from meshtide_codec.stream.session import Until

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_codec.compact.options import CompactOptions
    from meshtide_codec.limits import Limits
    from meshtide_codec.output_policy import OutputFile

COLLECTION = "meshes"
ORIGIN = "origin"
"""Member of each mesh in the list that names its source, for later exports."""
_FOREIGN = re.compile(r"[^a-z0-9_]+")
_LONGEST_ID = 100
_PIECE = 1 << 16


class FailedExport(NamedTuple):
    """A mesh that was not exported: its path or address without secrets, and why."""

    source: str
    error: str


class Export(NamedTuple):
    """What came of an export: all meshes of the folder, in the order of their ids, and those that failed."""

    meshes: tuple[ListedMesh, ...]
    failed: tuple[FailedExport, ...]


async def export_static(
    sources: Iterable[str],
    folder: Path,
    *,
    options: CompactOptions | ClassicOptions | None = None,
    link: Link | None = None,
    limits: Limits | None = None,
    notify: Callable[[str], None] = lambda _: None,
    overwrite: bool = False,
) -> Export:
    """Write a static copy of `sources` to `folder`; every packet is verified on the way.

    A mesh that cannot be read or used is reported and stops no other; what an earlier export made of it stays.

    Args:
        sources: `.tide` files and mesh files (encoded here), folders of them, addresses of servers (all meshes that are
            ready), of meshes, of `.tide` files on web servers and in buckets, and of buckets with a prefix (all below).
        folder: is made if it is missing; what it holds already stays, but for what an earlier export of the same
            source put there.
        options: how mesh files are encoded.
        link: timeout, retries and token.
        limits: what a stream may claim.
        notify: called with one sentence that a person should read.
        overwrite: whether any files of the same ids are replaced.

    Returns:
        All meshes of the folder, and what failed.

    Raises:
        OptionError: a source that is none; two that lead to one id, or one whose file is there already and is not its
            own. Nothing has been written then.
        TransferError, ProtocolError: a server or a bucket does not list its meshes.
        OSError: the list cannot be written.
    """
    collection = folder / COLLECTION
    output_folder(collection)
    link = link or Link()
    found = [item for source in sources for item in _items(source, link, notify)]
    if not found:
        raise OptionError("there is nothing to export: no source holds a .tide file or a mesh")
    earlier = _earlier(collection)
    listed = earlier or {}
    check_different((item.identifier, item.place) for item in found)
    index = output_file(
        collection / STATIC_INDEX, overwrite=overwrite, own=lambda _: earlier is not None, new_folder=True
    )
    targets = [_target(collection, item, listed.get(item.identifier), overwrite=overwrite) for item in found]
    failed: list[FailedExport] = []

    def tell_failure(place: str, error: MeshtideError | OSError) -> None:
        failed.append(FailedExport(place, explanation(error)))
        notify(f"{place} failed: {failed[-1].error}")

    for item, target in zip(found, targets, strict=True):
        place = shown_address(item.place) if "://" in item.place else item.place
        try:
            with made_folder(target.path.parent):
                if is_mesh_path(item.place):
                    target.write(_encoded(Path(item.place), options, notify))
                else:
                    await _copy(item.place, target, link, limits, notify)
            size = target.path.stat().st_size
        except (MeshtideError, OSError) as error:
            tell_failure(place, error)
            continue
        listed[item.identifier] = _Listed(item.file, item.origin, item.mesh)
        notify(f"{place}: {target.path}, {size} bytes")
    places = {path.relative_to(collection).with_suffix("").as_posix(): path for path in collection.rglob(f"*{SUFFIX}")}
    found_files = {identifier: path for identifier, path in places.items() if not re.search(r"(^|/)\.", identifier)}
    meshes = []
    for identifier, path in sorted(found_files.items()):
        try:
            meshes.append(_row(path, identifier, limits, listed.get(identifier)))
        except (MeshtideError, OSError) as error:
            tell_failure(str(path), error)
    rows = [asdict(mesh) | {ORIGIN: listed[mesh.id].origin if mesh.id in listed else None} for mesh in meshes]
    text = json_text(rows, indent=1)
    if rows or earlier is not None:
        index.write(text.encode())
    return Export(tuple(meshes), tuple(failed))


@dataclass(frozen=True, slots=True)
class _Item:
    """A mesh to be exported.

    Args:
        identifier: its id in the folder.
        place: path or address of its file.
        file: name of the file that it was made of, as the list has it.
        mesh: what a server says of it.
    """

    identifier: str
    place: str
    file: str
    mesh: ListedMesh | None = None

    @property
    def origin(self) -> str:
        """What a later export knows the same source by: a digest of its place, which itself is nobody's business."""
        place = self.place if "://" in self.place else os.path.realpath(self.place)
        return hashlib.sha256(os.fsencode(place)).hexdigest()


class _Listed(NamedTuple):
    """What the list holds of a mesh: the name of its file, the `origin` of its source, and what a server says of it."""

    file: str
    origin: str | None
    mesh: ListedMesh | None


def _target(collection: Path, item: _Item, earlier: _Listed | None, *, overwrite: bool) -> OutputFile:
    """The file of a mesh in the folder; one that an earlier export made of the same source may be replaced."""
    own = earlier is not None and earlier.origin == item.origin
    path = collection / f"{item.identifier}{SUFFIX}"
    return output_file(path, [item.place], overwrite=overwrite, own=lambda _: own, new_folder=True)


def _earlier(collection: Path) -> dict[str, _Listed] | None:
    """What the list says is there already, by ids; None if there is none that can be read."""
    try:
        rows = [(hosted_mesh(row), row.get(ORIGIN)) for row in json.loads((collection / STATIC_INDEX).read_bytes())]
        return {mesh.id: _Listed(mesh.name, origin, mesh) for mesh, origin in rows}
    except (OSError, ValueError, LookupError, TypeError, AttributeError, plain_values.BadValueError):
        return None


def _items(source: str, link: Link, notify: Callable[[str], None]) -> Iterable[_Item]:
    """Every mesh that `source` stands for."""
    path = Path(source)
    if path.is_dir():
        files = [file for file in sorted(path.iterdir()) if _is_exportable(file) and not file.is_dir()]
        for file in files:
            if (reason := oddity(file)) is not None:
                notify(f"{file} is left out: it {reason}")
        return [_file_item(file) for file in files if oddity(file) is None]
    if is_mesh_path(source) and "://" not in source:
        return [_file_item(path)]
    if source.startswith("s3://") and not source.endswith(SUFFIX):
        from meshtide_client.download.s3_source import list_files  # noqa: PLC0415 - an extra

        return [_address_item(url) for url in list_files(source, link.timeout, link.ca_file)]
    try:
        return [_address_item(source)]
    except OptionError as error:
        try:
            server = ServerAddress.parse(source)
        except OptionError:
            raise error from None
    hosted = list_meshes(source, timeout=link.timeout, token=link.token, ca_file=link.ca_file)
    for mesh in hosted:
        if mesh.status != "ready":
            notify(f"{mesh.id} is left out: it is {mesh.status}")
    return [
        _Item(_slug_of_path(mesh.id), server.mesh(mesh.id).page_url, mesh.name, mesh)
        for mesh in hosted
        if mesh.status == "ready"
    ]


def _file_item(path: Path) -> _Item:
    return _Item(_slug(split_name(path).stem), str(path), listed_name(path))


def _address_item(url: str) -> _Item:
    mesh = parse_address(url).mesh
    return _Item(_slug_of_path(mesh), url, listed_name(Path(f"{mesh}{SUFFIX}")))


def _is_exportable(file: Path) -> bool:
    return not file.name.startswith(".") and (file.suffix.lower() == SUFFIX or is_mesh_path(file))


def _encoded(path: Path, options: CompactOptions | ClassicOptions | None, notify: Callable[[str], None]) -> bytes:
    from meshtide_codec.encoder import encode  # noqa: PLC0415 - heavy
    from meshtide_codec.mesh_files import load_scene, mesh_of  # noqa: PLC0415 - the same
    from meshtide_codec.mesh_files.not_kept import notes_of_encoding  # noqa: PLC0415 - the same

    scene = load_scene(path)
    loaded = mesh_of(scene, path)
    for note in notes_of_encoding(scene, loaded):
        notify(f"{shown(path.name)}: {shown(note)}")
    return encode(loaded.mesh, options).to_bytes()


async def _copy(url: str, target: OutputFile, link: Link, limits: Limits | None, notify: Callable[[str], None]) -> None:
    """Read the whole stream at `url` into `target`, which appears only when all of it is there."""
    real = target.real_path
    partial = real.with_name(f".{real.name}.part")
    with (
        closing(PartialFile(partial, limits=limits, notify=notify, disposable=True)) as holding,
        ExitStack() as failure,
    ):
        failure.callback(holding.discard)
        attempts = Attempts(parse_address(url), holding, until=Until(), link=link, notify=notify, limits=limits)
        async with aclosing(attempts):
            while await attempts.next_events() is not None:
                pass  # packets are in the file by now
        move_into_place(partial, real, replace=target.replace)  # while no other export can write it
        failure.pop_all()


def _row(path: Path, identifier: str, limits: Limits | None, listed: _Listed | None) -> ListedMesh:
    """The line of the list for a file, with what was listed of it beside what it holds."""
    reader = ContainerReader(limits)
    with path.open("rb") as file:
        while reader.header is None and (piece := file.read(_PIECE)):
            reader.feed(piece)
    header = reader.header
    if header is None:
        raise ContainerError(f"{shown(path)} is not a whole .tide file; delete it and export again")
    own = ListedMesh(
        id=identifier,
        name=listed_name(path) if listed is None else listed.file,
        status="ready",
        stage=None,
        progress=1.0,
        reason=None,
        vertices=header.vertices,
        faces=header.faces,
        levels=len(header.levels),
        bytes=path.stat().st_size,
    )
    if listed is None or listed.mesh is None:
        return own
    mesh = listed.mesh
    return replace(
        own,
        tags=mesh.tags,
        licence=mesh.licence,
        created=mesh.created,
        updated=mesh.updated,
        box=mesh.box,
        source=mesh.source,
    )


def _slug_of_path(name: str) -> str:
    """An id that may hold slashes, each part of it a slug."""
    return "/".join(_slug(part) for part in name.split("/") if part) or _slug(name)


def _slug(name: str) -> str:
    """`name` in letters that mean themselves in every URL and file system; a number made of it if it has none."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode().lower()
    slug = _FOREIGN.sub("-", plain).strip("-")[:_LONGEST_ID].rstrip("-")
    return slug or f"mesh-{hashlib.sha256(os.fsencode(name)).hexdigest()[:8]}"
