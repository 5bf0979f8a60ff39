"""What `meshtide render` draws: mesh files and levels of streams, coloured by their distance if asked."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.closest_points import TriangleTree
from meshtide_codec.decoder import Decoder
from meshtide_codec.errors import OptionError
from meshtide_codec.mesh_files import load_mesh
from meshtide_codec.rendering.colour_scale import ColourScale
from meshtide_codec.rendering.picture import Subject
from meshtide_codec.samples import load_sample, sample_names
from meshtide_codec.stream.container import read_container

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from meshtide_codec.limits import Limits
    from meshtide_codec.mesh import Mesh

STREAM_SUFFIX = ".tide"


def load_subjects(inputs: Sequence[str], *, all_levels: bool = False, limits: Limits | None = None) -> list[Subject]:
    """The meshes of files, samples and streams, in order.

    Args:
        inputs: paths of mesh files or streams, or names of samples.
        all_levels: whether a stream shows all its levels, coarse to fine, or its finest.
        limits: what a stream may claim.

    Raises:
        MeshError, OSError: a file is not a mesh, or cannot be opened.
        StreamError: a stream is damaged.
    """
    subjects = []
    for name in inputs:
        path = Path(name)
        if path.suffix.lower() == STREAM_SUFFIX:
            subjects += list(_levels(path, limits, all_levels=all_levels))
        else:
            mesh = load_sample(name) if name in sample_names() and not path.exists() else load_mesh(path)
            subjects.append(Subject(path.stem, mesh))
    return subjects


def coloured_by_distance(subjects: Sequence[Subject], reference: Mesh) -> tuple[list[Subject], ColourScale]:
    """The subjects with the distance of each vertex from the surface of `reference`, and colours up to the largest.

    Distances are shares of the diagonal of the reference's bounding box.

    Raises:
        OptionError: the reference is a single point.
        MeshError: the reference cannot be measured.
    """
    diagonal = reference.diagonal
    if not diagonal > 0.0:
        raise OptionError("distances are shares of the reference's diagonal, and that of a single point is 0")
    centre = reference.vertices.mean(axis=0)
    tree = TriangleTree((reference.vertices - centre) / diagonal, reference.faces)
    coloured = []
    for subject in subjects:
        points = (subject.mesh.vertices - centre) / diagonal
        distances = np.linalg.norm(points - tree.closest(points).points, axis=1)
        coloured.append(Subject(subject.caption, subject.mesh, distances))
    largest = max(float(subject.values.max()) for subject in coloured if subject.values is not None)
    return coloured, ColourScale(0.0, largest or 1.0, "distance / diagonal")


def _levels(path: Path, limits: Limits | None, *, all_levels: bool) -> Iterator[Subject]:
    """Each level as it is shown when its last packet has come, before the Diffs of finer ones improve it."""
    header, packets = read_container(path.read_bytes(), limits)
    decoder = Decoder(header, limits)
    done = 0
    for row in header.levels:
        count = header.packet_count(row.level)
        for packet in packets[done:count]:
            decoder.push(packet)
        done = max(done, count)
        if all_levels or row is header.levels[-1]:
            yield Subject(f"{path.stem}, level {row.level}: {row.vertices} vertices", decoder.mesh(row.level))
