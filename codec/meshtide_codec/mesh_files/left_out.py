"""One line of what a file of some format does not keep of a scene."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from meshtide_codec.attributes import Kind

if TYPE_CHECKING:
    from collections.abc import Iterable

    from meshtide_codec.attributes import Attribute
    from meshtide_codec.scene import Scene

_WORDS = {
    Kind.COLOR: "colours",
    Kind.TEXCOORD: "texture coordinates",
    Kind.NORMAL: "normals",
}


def not_kept(scene: Scene, attributes: Iterable[Attribute], *, polygons: int = 0) -> list[str]:
    """A line for what is lost of a scene, or none.

    Args:
        scene: that is written.
        attributes: that are not.
        polygons: how many become triangles.

    >>> from meshtide_codec.scene import Material, Scene
    >>> not_kept(Scene((), materials=(Material(),)), [])
    ['1 material: not kept']
    """
    counts = Counter[str]()
    for one in attributes:
        counts[_WORDS.get(one.kind, one.name)] += len(one.values)
    parts = [f"{name} ({count})" for name, count in counts.items()]
    for many, word in ((len(scene.materials), "material"), (len(scene.images), "image"), (polygons, "polygon")):
        if many:
            parts.append(f"{many} {word}{'' if many == 1 else 's'}")
    return [f"{', '.join(parts)}: not kept"] if parts else []
