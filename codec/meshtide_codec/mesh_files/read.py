"""From the path of a mesh file to a scene, or to one mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshError, MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.formats import SUFFIXES, content_kind, reader_of
from meshtide_codec.mesh_files.other_formats import read_other
from meshtide_codec.mesh_files.source import Source, format_suffix, open_source

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from meshtide_codec.scene import Scene


@dataclass(frozen=True, slots=True)
class SceneMesh:
    """A scene as the one mesh that is encoded.

    Args:
        mesh: all that is shown.
        unreferenced: vertices that no face uses and that were left out.
        notes: what a person should know of it.
        not_finite: index in the scene's mesh of the first vertex that was left out because a coordinate of it is not
            finite, or None.
    """

    mesh: Mesh
    unreferenced: int
    notes: tuple[str, ...]
    not_finite: int | None = None

    def check_order(self, name: Path | str) -> None:
        """Make sure that vertices stand as the file of that name has them, for those who store their order.

        Raises:
            MeshError: one was left out that is not finite, so that all later ones have other indices.
        """
        if self.not_finite is not None:
            raise MeshError(
                f"{name}: vertex {self.not_finite} is not finite and of no face, so it cannot be kept, and the order "
                "of the vertices would not be the file's; give it finite coordinates, or leave --store-order out"
            )


def is_mesh_path(path: Path | str) -> bool:
    """Whether the name of a file ends like that of a mesh, packed by gzip or not.

    >>> is_mesh_path("bunny.PLY"), is_mesh_path("bunny.obj.gz"), is_mesh_path("notes.txt")
    (True, True, False)
    """
    return format_suffix(str(path)) in SUFFIXES


def load_scene(
    path: Path | str, *, limits: FileLimits | None = None, kind: str | None = None, alone: bool = False
) -> Scene:
    """Read all that a mesh file holds.

    Args:
        path: of the file, or `-` for standard input.
        limits: what it may claim.
        kind: of its content, such as ply, in place of what its name says.
        alone: whether the file may name no others: for files of strangers.

    Raises:
        MeshFileError: the file is not a mesh, holds less than it declares, claims too much, or is of a format that
            cannot be read.
        OSError: the file cannot be opened.
    """
    limits = limits or FileLimits()
    try:
        source = open_source(path, limits, kind=kind, alone=alone)
        return read_source(source, limits)
    except MeshError as error:
        raise MeshFileError(f"{path} cannot be read as a mesh: {error}") from error


def read_source(source: Source, limits: FileLimits) -> Scene:
    """Read what a source holds; its notes become those of the scene.

    Raises:
        MeshError: see `load_scene`; the message does not name the file.
    """
    found = content_kind(bytes(source.view[:64]))
    if not source.view:
        raise MeshFileError("it is empty")
    if not source.suffix and found in SUFFIXES:
        source = replace(source, suffix=found)
    if found is not None and found != source.suffix and source.suffix in ("", *SUFFIXES):  # others may be archives
        raise MeshFileError(f"it is taken for *{source.suffix}, but its content is {found.lstrip('.')}")
    if not source.suffix:
        raise MeshFileError("its name does not show the format; --format names it, such as ply or obj")
    reader = reader_of(source.suffix) or read_other
    with np.errstate(invalid="ignore", over="ignore"):  # numbers that are none are refused by the name of their vertex
        scene = reader(source, limits)
    limits.check_counts(*scene.counts())
    return replace(scene, notes=(*scene.notes, *source.notes))


def mesh_of(scene: Scene, name: Path | str = "", *, keep_unreferenced: bool = False) -> SceneMesh:
    """The one mesh of a scene, checked.

    Args:
        scene: as it was read.
        name: of its file, for messages to begin with.
        keep_unreferenced: whether vertices that no face uses stay (they cannot be seen, but cost bytes).

    Raises:
        MeshError: there are no faces in it, or a coordinate of a vertex that is used is not finite.
    """
    try:
        with np.errstate(invalid="ignore", over="ignore"):
            return _checked(scene.mesh(), scene.notes, keep_unreferenced=keep_unreferenced)
    except MeshError as error:
        raise type(error)(f"{name}: {error}" if name else str(error)) from error


def _checked(mesh: Mesh, found: Sequence[str], *, keep_unreferenced: bool) -> SceneMesh:
    notes = list(found)
    not_finite = None
    if len(mesh.vertices) == 0:
        raise MeshFileError("there are no vertices in it")
    if len(mesh.faces) == 0:
        raise MeshFileError(f"there are no faces in it{_because(notes)}")
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.faces.reshape(-1)] = True
    finite = used.all() or np.isfinite(mesh.vertices).all()
    if not finite and (unfinished := ~used & ~np.isfinite(mesh.vertices).all(axis=1)).any():
        count, not_finite = int(unfinished.sum()), int(np.argmax(unfinished))
        notes.append(f"{count} {'vertex is' if count == 1 else 'vertices are'} not finite and of no face: left out")
        mesh, used = mesh.with_vertices(~unfinished), used[~unfinished]
    mesh = Mesh.checked(mesh.vertices, mesh.faces, mesh.attributes, mesh.materials, mesh.polygons)
    unreferenced = 0 if keep_unreferenced else int((~used).sum())
    return SceneMesh(mesh.with_vertices(used) if unreferenced else mesh, unreferenced, tuple(notes), not_finite)


def _because(notes: list[str]) -> str:
    """What was left out of a file of which nothing is left."""
    return f" ({'; '.join(notes)})" if notes else ""


def load_mesh(
    path: Path | str,
    *,
    keep_unreferenced: bool = False,
    limits: FileLimits | None = None,
    kind: str | None = None,
    alone: bool = False,
) -> Mesh:
    """Read all that a mesh file shows as one mesh, with its attributes.

    Args:
        path: of the file, or `-` for standard input.
        keep_unreferenced: whether vertices that no face uses stay (they cannot be seen, but cost bytes).
        limits: what the file may claim.
        kind: of its content, such as ply, in place of what its name says.
        alone: whether the file may name no others: for files of strangers.

    Raises:
        MeshFileError: the file is not a mesh, holds less than it declares, or is of a format that cannot be read.
        MeshError: it holds a mesh that is not usable.
        OSError: the file cannot be opened.
    """
    scene = load_scene(path, limits=limits, kind=kind, alone=alone)
    return mesh_of(scene, path, keep_unreferenced=keep_unreferenced).mesh
