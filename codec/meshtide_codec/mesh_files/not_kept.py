"""What a scene holds that a stream does not: told once, in one line, with numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.attributes import Attribute, Kind

if TYPE_CHECKING:
    from meshtide_codec.mesh_files.read import SceneMesh
    from meshtide_codec.scene import Scene

_WORDS = {
    Kind.TEXCOORD: "texture coordinates",
    Kind.NORMAL: "normals",
    Kind.COLOR: "colours",
}
_USUAL_NAMES = frozenset({"TEXCOORD_0", "NORMAL", "COLOR_0"})
_PARTS_OF_DOCUMENT = ("animations", "cameras")


def notes_of_encoding(scene: Scene, loaded: SceneMesh) -> list[str]:
    """All that a person should know who has a stream made of a file: what was read otherwise, and what is not kept."""
    left_out = not_kept(scene)
    return [*loaded.notes, *([] if left_out is None else [left_out])]


def not_kept(scene: Scene) -> str | None:
    """The line, without the name of the file; None where positions and triangles of one part are all there is.

    >>> import numpy as np
    >>> from meshtide_codec.mesh import Mesh
    >>> from meshtide_codec.scene import Material, Scene
    >>> uv = Attribute("TEXCOORD_0", Kind.TEXCOORD, "vertex", np.zeros((3, 2)))
    >>> mesh = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], [uv])
    >>> not_kept(Scene.of(mesh, [Material("red")]))
    'texture coordinates (3), 1 material: not kept'
    >>> not_kept(Scene.of(Mesh(mesh.vertices, mesh.faces)))
    """
    values: dict[str, int] = {}
    for geometry in scene.geometries:
        for attribute in geometry.attributes:
            word = _word(attribute)
            values[word] = values.get(word, 0) + len(attribute.values)
    parts = [f"{word} ({count})" for word, count in values.items()]
    parts += _counted("material", len(scene.materials)) + _counted("image", len(scene.images))
    placed = sum(1 for _ in zip(range(2), scene.placements(), strict=False))
    if placed > 1:
        parts.append(f"{sum(node.geometry is not None for node in scene.nodes)} nodes (their meshes become one)")
    for name in _PARTS_OF_DOCUMENT:
        held = scene.document.get(name)
        parts += _counted(name.removesuffix("s"), len(held) if isinstance(held, list) else 0)
    inner = sum(int(one.polygons.sum()) // 2 for one in scene.geometries if one.polygons is not None)
    if inner:
        parts.append(f"polygons ({inner} edges inside of them)")
    return f"{', '.join(parts)}: not kept" if parts else None


def _word(attribute: Attribute) -> str:
    word = _WORDS.get(attribute.kind)
    if word is None:
        return attribute.name
    return word if attribute.name in _USUAL_NAMES else f"{word} {attribute.name}"


def _counted(word: str, count: int) -> list[str]:
    return [] if count == 0 else [f"{count} {word}" if count == 1 else f"{count} {word}s"]
