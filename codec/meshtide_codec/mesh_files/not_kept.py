"""What a scene holds that a stream or a file of some format does not: reported once, in one line, with numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.attributes import Attribute, Kind

if TYPE_CHECKING:
    from collections.abc import Iterable

    from meshtide_codec.mesh_files.read import SceneMesh
    from meshtide_codec.scene import Scene

_WORDS = {
    Kind.TEXCOORD: "texture coordinates",
    Kind.NORMAL: "normals",
    Kind.COLOR: "colours",
}
_USUAL_NAMES = frozenset({"TEXCOORD_0", "NORMAL", "COLOR_0"})
_OF_DOCUMENT = ("animations", "cameras")
_TRIANGLE = 3


def notes_of_encoding(scene: Scene, loaded: SceneMesh) -> list[str]:
    """All that a person should know who has a stream made of a file: what was read otherwise, and what is not kept."""
    return [*loaded.notes, *not_kept(scene)]


def not_kept(scene: Scene, attributes: Iterable[Attribute] | None = None, *, kept: Iterable[str] = ()) -> list[str]:
    """A line, without the name of a file, for what is lost of a scene, or none.

    Args:
        scene: that is written.
        attributes: of its meshes that are lost; None for all.
        kept: what else is not lost, of materials, images, nodes, animations, cameras, polygons.

    >>> import numpy as np
    >>> from meshtide_codec.mesh import Mesh
    >>> from meshtide_codec.scene import Material, Scene
    >>> uv = Attribute("TEXCOORD_0", Kind.TEXCOORD, "vertex", np.zeros((3, 2)))
    >>> mesh = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], [uv])
    >>> not_kept(Scene.of(mesh, [Material("red")]))
    ['texture coordinates (3), 1 material: not kept']
    >>> not_kept(Scene.of(mesh, [Material("red")]), [], kept=["materials"])
    []
    """
    if attributes is None:
        attributes = (one for mesh in scene.geometries for one in mesh.attributes)
    values: dict[str, int] = {}
    for one in attributes:
        word = _word(one)
        values[word] = values.get(word, 0) + len(one.values)
    parts = [f"{word} ({count})" for word, count in values.items()]
    kept = set(kept)
    parts += [] if "materials" in kept else _counted("material", len(scene.materials))
    parts += [] if "images" in kept else _counted("image", len(scene.images))
    if "nodes" not in kept and sum(1 for _ in zip(range(2), scene.placements(), strict=False)) > 1:
        parts.append(f"{sum(node.geometry is not None for node in scene.nodes)} nodes (their meshes become one)")
    for name in _OF_DOCUMENT:
        held = scene.document.get(name)
        parts += _counted(name.removesuffix("s"), len(held) if isinstance(held, list) and name not in kept else 0)
    if "polygons" not in kept:
        counts = (mesh.outlines()[1] for mesh in scene.geometries if mesh.polygons is not None)
        polygons = sum(int((one > _TRIANGLE).sum()) for one in counts)
        parts += [f"{one} (now triangles)" for one in _counted("polygon", polygons)]
    return [f"{', '.join(parts)}: not kept"] if parts else []


def _word(attribute: Attribute) -> str:
    word = _WORDS.get(attribute.kind)
    if word is None:
        return attribute.name
    return word if attribute.name in _USUAL_NAMES else f"{word} {attribute.name}"


def _counted(word: str, count: int) -> list[str]:
    return [] if count == 0 else [f"{count} {word}" if count == 1 else f"{count} {word}s"]
