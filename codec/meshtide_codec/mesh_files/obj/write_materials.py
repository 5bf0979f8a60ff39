"""Materials and images of a scene as an MTL file and the images beside it.

Materials that came from an MTL file are written as they were, but for the names of their images, which all lie beside
the file. Those of glTF become `Kd`, `d`, `Ke`, `Pm`, `Pr`, `map_Kd`, `map_Ke` and `norm`.
"""

from __future__ import annotations

import posixpath
import re
from typing import TYPE_CHECKING, Any

from meshtide_codec.mesh_files.obj.textures import texture_line

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from meshtide_codec.scene import Image, Material, Scene

_SUFFIXES = {"image/png": ".png", "image/jpeg": ".jpg", "image/webp": ".webp", "image/ktx2": ".ktx2"}
_UNSAFE = re.compile(r'[\x00-\x1f\x7f<>:"|?*\\/]')
_BREAKS = re.compile(r"[\x00-\x20\x7f\x85\u2028\u2029]+")
_COMMENT = re.compile(r"(?:^|(?<= ))#(?!\d)")
_LONGEST_NAME = 100  # characters of a file's name; many systems take 255 bytes
_KNOWN = {"pbrMetallicRoughness", "emissiveFactor", "emissiveTexture", "normalTexture", "alphaMode", "mtl", "name"}
_KNOWN_OF_SURFACE = {"baseColorFactor", "baseColorTexture", "metallicFactor", "roughnessFactor"}


def written_name(name: str) -> str:
    r"""A name as a line of an OBJ or MTL file can hold it: blanks of all kinds are one, and nothing is a comment.

    >>> written_name("two\nlines  #x\\")
    'two lines _x_'
    """
    shown = _COMMENT.sub("_", _BREAKS.sub(" ", name).strip())
    shown = shown.encode("utf-8", "replace").decode()
    return f"{shown[:-1]}_" if shown.endswith("\\") else shown


def unique_names(names: Sequence[str], kind: str) -> list[str]:
    """Names that a file can hold, none of them twice; a name that is missing becomes `kind` and its number."""
    taken = set()
    result = []
    for place, name in enumerate(names):
        plain = written_name(name) or f"{kind}_{place}"
        unique, number = plain, 1
        while unique in taken:
            number += 1
            unique = f"{plain}_{number}"
        taken.add(unique)
        result.append(unique)
    return result


def image_files(images: Sequence[Image], taken: Collection[str]) -> list[str]:
    """A name of a file for each image, in one folder with the files of other names `taken`."""
    used = {name.casefold() for name in taken}
    result = []
    for place, image in enumerate(images):
        base = _UNSAFE.sub("_", posixpath.basename(image.name.replace("\\", "/"))).strip(". ")[-_LONGEST_NAME:]
        stem, suffix = posixpath.splitext(written_name(base) or f"image_{place}")
        suffix = suffix or _SUFFIXES.get(image.mime_type, "")
        name, number = f"{stem}{suffix}", 1
        while name.casefold() in used:
            number += 1
            name = f"{stem}_{number}{suffix}"
        used.add(name.casefold())
        result.append(name)
    return result


def mtl_text(scene: Scene, names: Sequence[str], files: Sequence[str]) -> tuple[str, int]:
    """The MTL file of a scene's materials, and how many materials hold what it has no words for.

    Args:
        scene: its materials, images and textures.
        names: of the materials, as `usemtl` has them.
        files: of the images.
    """
    by_name = {image.name: file for image, file in zip(scene.images, files, strict=True)}
    parts = ["# written by meshtide\n"]
    poorer = 0
    for material, name in zip(scene.materials, names, strict=True):
        parts.append(f"\nnewmtl {name}\n")
        lines = material.properties.get("mtl")
        if isinstance(lines, list) and all(isinstance(line, str) for line in lines):
            parts += [f"{_line(line, by_name)}\n" for line in lines if not line.lstrip().startswith("newmtl")]
        else:
            parts += [f"{line}\n" for line in _lines(material, scene, files)]
            poorer += _is_poorer(material)
    return "".join(parts), poorer


def _line(line: str, by_name: Mapping[str, str]) -> str:
    found = texture_line(line)
    if found is not None:
        file = by_name.get(found.name.replace("\\", "/"))
        if file is not None:
            return f"{written_name(found.before)} {file}"
    return written_name(line)


def _lines(material: Material, scene: Scene, files: Sequence[str]) -> list[str]:
    """A material in glTF's words as lines; what is not of the type that glTF asks for is left out."""
    surface = _mapping(material.properties.get("pbrMetallicRoughness"))
    *color, alpha = _factors(surface.get("baseColorFactor"), 4) or [1.0] * 4
    lines = [f"Kd {_spaced(color)}"]
    if alpha < 1 and material.properties.get("alphaMode") != "OPAQUE":
        lines.append(f"d {alpha!r}")
    emission = _factors(material.properties.get("emissiveFactor"), 3)
    if emission:
        lines.append(f"Ke {_spaced(emission)}")
    for word, key in (("Pm", "metallicFactor"), ("Pr", "roughnessFactor")):
        factor = _factors([surface.get(key)], 1)
        if factor:
            lines.append(f"{word} {factor[0]!r}")
    for word, texture in (
        ("map_Kd", surface.get("baseColorTexture")),
        ("map_Ke", material.properties.get("emissiveTexture")),
        ("norm", material.properties.get("normalTexture")),
    ):
        image = _image(texture, scene)
        if image is not None:
            lines.append(f"{word} {files[image]}")
    return lines


def _image(texture: object, scene: Scene) -> int | None:
    """The image of a texture reference."""
    textures = scene.document.get("textures")
    index = _mapping(texture).get("index")
    if not isinstance(textures, list) or not isinstance(index, int) or not 0 <= index < len(textures):
        return None
    source = _mapping(textures[index]).get("source")
    return source if isinstance(source, int) and 0 <= source < len(scene.images) else None


def _is_poorer(material: Material) -> bool:
    surface = _mapping(material.properties.get("pbrMetallicRoughness"))
    return bool(set(material.properties) - _KNOWN or set(surface) - _KNOWN_OF_SURFACE)


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _factors(value: object, count: int) -> list[float]:
    """So many numbers, or none."""
    if not isinstance(value, list | tuple) or len(value) != count:
        return []
    return [float(one) for one in value] if all(isinstance(one, int | float) for one in value) else []


def _spaced(numbers: Sequence[float]) -> str:
    return " ".join(map(repr, numbers))
