"""Morph targets at their default weights and skins in their bind pose: what a viewer shows before anything moves.

Format: Khronos, "glTF 2.0 Specification", sections 3.7.2.2 (morph targets) and 3.7.3 (skins). A skinned mesh stands
where its joints put it: the transformation of the node that shows it does not count.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf.accessors import real
from meshtide_codec.mesh_files.gltf.document import integers, optional
from meshtide_codec.scene import IDENTITY

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from meshtide_codec.mesh_files.gltf.accessors import Accessors, Table
    from meshtide_codec.mesh_files.gltf.document import Document

    Floats = NDArray[np.float64]

_PIECE = 1 << 12
"""Vertices that are moved at a time: a matrix of each takes 128 bytes."""


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Where a skin puts vertices.

    Args:
        joints: (j, 4, 4), from the coordinates of the mesh to those of the scene.
        mirrors: whether all joints turn the inside out.
        otherwise: (4, 4) for parts that have no joints.
    """

    joints: Floats
    mirrors: bool
    otherwise: Floats


def bind_poses(
    document: Document, accessors: Accessors, users: Mapping[int, int], worlds: Floats
) -> dict[int, tuple[Floats, bool]]:
    """Of each skin in its bind pose the matrices (j, 4, 4) of its joints, and whether all of them mirror.

    Args:
        document: of the file.
        accessors: of the file.
        users: by the number of each skin a node that names it.
        worlds: (k, 4, 4), the matrices of all nodes.

    Raises:
        MeshFileError: a skin names what is not there.
    """
    if not users:
        return {}
    skins = [_joints(document, accessors, skin, node, len(worlds)) for skin, node in users.items()]
    starts = np.cumsum([0, *(len(joints) for joints, _ in skins)])
    columns = np.concatenate([inverse for _, inverse in skins])
    with np.errstate(all="ignore"):  # what overflows is refused where vertices are checked
        matrices = worlds[[joint for joints, _ in skins for joint in joints]] @ columns.transpose(0, 2, 1)
        mirrors = np.linalg.det(matrices[starts[:-1], :3, :3]) < 0  # most skins have no joint that does
        parts = [matrices[start:end] for start, end in itertools.pairwise(starts)]
        return {
            skin: (part, bool(first and (np.linalg.det(part[:, :3, :3]) < 0).all()))
            for skin, part, first in zip(users, parts, mirrors, strict=True)
        }


def _joints(document: Document, accessors: Accessors, skin: int, node: int, nodes: int) -> tuple[list[int], Floats]:
    """The nodes that are the joints of a skin, and their inverse bind matrices (j, 4, 4), each by its columns."""
    row = document.row("skins", skin, f"nodes[{node}]")
    where = f"skins[{skin}]"
    joints = integers(row, "joints", where)
    if not joints or max(joints) >= nodes:
        raise MeshFileError(f"{where} has joints that are not nodes")
    inverse = optional(row, "inverseBindMatrices", where)
    if inverse is None:
        return joints, np.broadcast_to(IDENTITY, (len(joints), 4, 4))
    form = accessors.form(inverse, where)
    if form.shape != "MAT4" or form.count < len(joints):
        raise MeshFileError(f"accessors[{inverse}] has no matrix for each of the {len(joints)} joints of {where}")
    return joints, accessors.real(inverse, where)[: len(joints)].reshape(-1, 4, 4)


@np.errstate(all="ignore")  # what is not finite is refused where the mesh is checked
def posed(
    points: Floats, directions: Sequence[NDArray[Any]], sets: Sequence[tuple[Table, Table]], pose: Pose, where: str
) -> tuple[Floats, list[NDArray[np.float32]]]:
    """Points and directions where the joints of a skin put them.

    Args:
        points: (n, 3).
        directions: such as normals (n, 3) or tangents (n, 4), whose fourth component changes its sign where
            all joints mirror; they get length one.
        sets: joints (n, 4) and weights (n, 4), one pair for each set; without any the pose's other matrix is taken.
        pose: of the skin.
        where: the primitive, for messages.

    Raises:
        MeshFileError: a joint with a weight is none of the skin's.
    """
    moved = np.empty_like(points)
    turned = [np.array(one, np.float32) for one in directions]
    for start in range(0, len(points), _PIECE):
        piece = slice(start, min(start + _PIECE, len(points)))
        matrices = _blended(piece, sets, pose, where)
        linear = matrices[:, :3, :3]
        moved[piece] = np.einsum("kij,kj->ki", linear, points[piece]) + matrices[:, :3, 3]
        for source, result in zip(directions, turned, strict=True):
            vectors = np.einsum("kij,kj->ki", linear, source[piece, :3])
            lengths = np.sqrt(np.einsum("ki,ki->k", vectors, vectors))
            lengths[lengths == 0] = 1
            result[piece, :3] = vectors / lengths[:, None]
    if pose.mirrors:
        for result in turned:
            result[:, 3:] *= -1
    return moved, turned


def _blended(piece: slice, sets: Sequence[tuple[Table, Table]], pose: Pose, where: str) -> Floats:
    """The matrices (k, 3, 4) that move the vertices of a piece."""
    count = piece.stop - piece.start
    if not sets:
        return np.broadcast_to(pose.otherwise[:3], (count, 3, 4))
    flat = pose.joints[:, :3].reshape(-1, 12)
    matrices = np.zeros((count, 12))
    total = np.zeros(count)
    first = np.zeros(count, np.int64)
    for number, (joint_table, weight_table) in enumerate(sets):
        columns = weight_table.values[piece].T.copy()
        for column in np.flatnonzero(columns.any(axis=1)):  # most skins leave some empty
            weights = real(columns[column], normalized=weight_table.normalized)
            joints = joint_table.values[piece, column].astype(np.int64)
            rigid = (weights == 1).all()
            if not rigid:
                weights[~np.isfinite(weights)] = 0
                joints[weights == 0] = 0
            largest = joints.max()
            if largest >= len(pose.joints):
                raise MeshFileError(f"{where} has vertices of joint {largest}; its skin has {len(pose.joints)} joints")
            if number == column == 0:
                first = joints
            total += weights
            chosen = flat.take(joints, axis=0)
            matrices += chosen if rigid else weights[:, None] * chosen
    if not (total == 1).all():
        free = total == 0  # a vertex of no joint goes with the first
        matrices[free] = flat[first[free]]
        total[free] = 1
        matrices /= total[:, None]
    return matrices.reshape(count, 3, 4)


def morphed(
    values: Floats,
    name: str,
    targets: Sequence[Mapping[str, int]],
    weights: Sequence[float],
    accessors: Accessors,
    *,
    where: str,
    count: int,
    chosen: NDArray[np.int64] | None,
) -> Floats:
    """Values (n, c) of an attribute with the differences of its targets added, each by its weight.

    Of the targets' elements the `chosen` ones belong to the values, or all of them.

    Raises:
        MeshFileError: a target has another number of elements or components.
    """
    result = values
    for target, weight in zip(targets, weights, strict=False):
        if weight == 0 or name not in target:
            continue
        index = target[name]
        form = accessors.form(index, where)
        wide = form.width == values.shape[1] or (name == "TANGENT" and form.width == 3)
        if form.count != count or not wide:
            raise MeshFileError(
                f"accessors[{index}], {name} of a target of {where}, has {form.count} elements of {form.width} "
                f"components; the primitive has {count} of {values.shape[1]}"
            )
        result = result.copy() if result is values else result
        with np.errstate(all="ignore"):
            stored = accessors.array(index, where)
            stored = stored if chosen is None else stored[chosen]
            result[:, : form.width] += weight * real(stored, normalized=form.normalized)
    return result
