"""MTL, the materials of OBJ files: read into glTF's words, the lines themselves kept; images as bytes.

`Kd` and `d` (or `Tr`) become the base colour, `map_Kd` its texture, `Ke` the emission, `Pm` and `Pr` metal and
roughness, `norm` the normal map. Nothing is decoded. Format: "MTL material format (Lightwave, OBJ)", Alias/Wavefront,
1995, with the later words Ke, Pm, Pr, norm.
"""

from __future__ import annotations

import posixpath
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.encodings import CONTROL, plain_text
from meshtide_codec.mesh_files.obj.statements import shown_name, without_comment
from meshtide_codec.mesh_files.obj.textures import texture_line
from meshtide_codec.scene import Image, Material

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.source import Source

_MOST_LIBRARIES = 64
_MOST_IMAGES = 1024
"""More files than any scene names; each is looked for on the disk."""

_NAMED = re.compile(rb"\s*(newmtl|map_\w+|norm|bump|disp|decal|refl)\s")
_TEXTURES = {
    "map_kd": ("pbrMetallicRoughness", "baseColorTexture"),
    "map_ke": ("emissiveTexture",),
    "norm": ("normalTexture",),
    "map_norm": ("normalTexture",),
}
_MIME_TYPES = (
    (b"\x89PNG", "image/png"),
    (b"\xff\xd8\xff", "image/jpeg"),
    (b"RIFF", "image/webp"),
    (b"\xabKTX 20", "image/ktx2"),
    (b"BM", "image/bmp"),
    (b"GIF8", "image/gif"),
)


@dataclass(slots=True)
class Materials:
    """The materials of a file, their images and their textures, glTF's word for the use of an image."""

    materials: tuple[Material, ...] = ()
    images: tuple[Image, ...] = ()
    textures: tuple[dict[str, Any], ...] = ()
    rows: dict[bytes, int] = field(default_factory=dict)

    def places(self, names: Sequence[bytes]) -> NDArray[np.int64]:
        """Which materials some names, as the file has them, stand for."""
        return np.array([self.rows[name] for name in names], np.int64)


def read_materials(source: Source, limits: FileLimits, libraries: Sequence[bytes], used: Sequence[bytes]) -> Materials:
    """Read the material files beside a mesh file; what is missing or lies elsewhere is reported.

    Args:
        source: the mesh file.
        limits: how large each file may be.
        libraries: the material files that it names.
        used: the materials that it names, which come first; those of the libraries follow.
    """
    folder = _Folder(source, limits)
    declared: dict[bytes, tuple[str, list[str]]] = {}  # the folder of the library, and the lines
    for name in libraries[:_MOST_LIBRARIES]:
        for reference, data in folder.libraries(name):
            text, damaged = _without_damaged_lines(plain_text(data))
            if damaged:
                source.note(f"{shown_name(name)[:80]!r}: lines with control bytes, left out: {damaged}")
            for material, lines in parse_mtl(text).items():
                declared.setdefault(material, (posixpath.dirname(reference), lines))
    if len(libraries) > _MOST_LIBRARIES:
        source.note(f"material files: {len(libraries)} are named, the first {_MOST_LIBRARIES} are looked for")
    names = list(dict.fromkeys([*used, *declared]))
    materials = []
    for name in names:
        properties: dict[str, Any] = {}
        if name in declared:
            beside, lines = declared[name]
            properties = _properties(lines, folder, beside)
        materials.append(Material(shown_name(name), properties))
    unknown = [shown_name(name) for name in used if name not in declared]
    if unknown and not folder.left_out:
        source.note(f"materials that no material file describes: {len(unknown)} ({_listed(unknown)})")
    folder.report()
    rows = {name: row for row, name in enumerate(names)}
    return Materials(tuple(materials), tuple(folder.images), tuple(folder.textures), rows)


def parse_mtl(data: bytes) -> dict[bytes, list[str]]:
    r"""The lines of each material of an MTL file, without newmtl, comments, blank lines and indents.

    >>> parse_mtl(b"newmtl red\n  Kd 1 0 0  # bright\n")
    {b'red': ['Kd 1 0 0']}
    """
    found: dict[bytes, list[str]] = {}
    lines: list[str] | None = None
    for line in plain_text(data).split(b"\n"):
        words = without_comment(line).split(None, 1)
        if not words:
            continue
        if words[0] == b"newmtl":
            lines = []
            found.setdefault(words[1] if len(words) > 1 else b"", lines)
        elif lines is not None:
            lines.append(b" ".join(words).decode("utf-8", "surrogateescape"))
    return found


def _without_damaged_lines(text: bytes) -> tuple[bytes, int]:
    """A plain text without lines that have control bytes before a comment and no name; how many these are."""
    if CONTROL.search(text) is None:
        return text, 0
    lines = text.split(b"\n")
    kept = [line for line in lines if CONTROL.search(without_comment(line)) is None or _NAMED.match(line)]
    return b"\n".join(kept), len(lines) - len(kept)


class _Folder:
    """The files beside a mesh file: looked for once, and reported once."""

    def __init__(self, source: Source, limits: FileLimits) -> None:
        self._source = source
        self._limits = limits
        self.images: list[Image] = []
        self.textures: list[dict[str, Any]] = []
        self._missing_libraries: list[str] = []
        self._missing_images: list[str] = []
        self._refused: list[str] = []
        self._textures: dict[str, int] = {}

    @property
    def left_out(self) -> bool:
        """Whether a file that is named was not read."""
        return bool(self._missing_libraries or self._refused)

    def libraries(self, name: bytes) -> list[tuple[str, bytes]]:
        """The references and bytes of what one mtllib names: a file, whose name may hold blanks, or several."""
        reference = name.decode("utf-8", "surrogateescape")
        if self._source.folder is None:
            self._refused.append(reference)
            return []
        data = self._bytes(reference)
        if data is not None:
            return [(reference, data)]
        several = reference.split()
        if len(several) > 1 and all(part.lower().endswith(".mtl") for part in several):
            found = [(part, self._bytes(part)) for part in several[:_MOST_LIBRARIES]]
        else:
            found = [(reference, None)]
        self._missing_libraries += [part for part, data in found if data is None and part not in self._refused]
        return [(part, data) for part, data in found if data is not None]

    def texture(self, name: str, beside: str) -> int:
        """The texture of an image file that a library in the folder `beside` names."""
        name = name.replace("\\", "/")
        known = self._textures.get(name)
        if known is not None:
            return known
        data = None
        if len(self.images) < _MOST_IMAGES:
            below = posixpath.join(beside.replace("\\", "/"), name)
            data = self._bytes(below)
            if data is None and below != name:
                data = self._bytes(name)
            if data is None and name not in self._refused:
                self._missing_images.append(name)
        elif len(self.images) == _MOST_IMAGES:
            self._source.note(f"images: the first {_MOST_IMAGES} are looked for")
        shown = name.encode("utf-8", "surrogateescape").decode("utf-8", "replace")
        self.textures.append({"source": len(self.images)})
        self.images.append(Image(shown, data or b"", _mime_type(data or b"")))
        self._textures[name] = len(self.textures) - 1
        return self._textures[name]

    def _bytes(self, reference: str) -> bytes | None:
        try:
            return self._source.beside(reference, self._limits)
        except MeshFileError:  # elsewhere, unreadable, or no name of a file
            self._refused.append(reference)
            return None

    def report(self) -> None:
        """Report what was missing or refused, a line for each kind."""
        for what, names in (
            ("material files that are missing", self._missing_libraries),
            ("images that are missing", self._missing_images),
            ("files that lie elsewhere or cannot be read, left out", self._refused),
        ):
            if names:
                self._source.note(f"{what}: {len(names)} ({_listed(names)})")


def _listed(names: list[str]) -> str:
    shown = [repr(name[:80]) for name in names[:3]]
    return ", ".join(shown) + (", ..." if len(names) > len(shown) else "")


def _mime_type(data: bytes) -> str:
    return next((kind for magic, kind in _MIME_TYPES if data.startswith(magic)), "")


def _properties(lines: list[str], folder: _Folder, beside: str) -> dict[str, Any]:
    """The lines of a material in glTF's words, and as they stand."""
    properties: dict[str, Any] = {}
    surface: dict[str, Any] = {"metallicFactor": 0.0}
    color = [1.0, 1.0, 1.0]
    opacity: dict[str, float] = {}
    for line in lines:
        word, *values = line.split()
        numbers = _numbers(values)
        match word.lower(), numbers:
            case "kd" | "ke" as key, [_] | [_, _, _]:  # green and blue are as red where they are not given
                if key == "kd":
                    color = (numbers * 3)[:3]
                elif any(numbers):
                    properties["emissiveFactor"] = (numbers * 3)[:3]
            case "d" | "tr" as key, [number]:
                opacity[key] = number if key == "d" else 1.0 - number
            case "pm" | "pr" as key, [number]:
                surface["metallicFactor" if key == "pm" else "roughnessFactor"] = number
            case key, _ if key in _TEXTURES:
                _add_texture(line, _TEXTURES[key], properties, surface, folder, beside)
    alpha = opacity.get("d", opacity.get("tr", 1.0))
    surface["baseColorFactor"] = [*color, alpha]
    properties["pbrMetallicRoughness"] = surface
    if alpha < 1:
        properties["alphaMode"] = "BLEND"
    properties["mtl"] = [line.encode("utf-8", "surrogateescape").decode("utf-8", "replace") for line in lines]
    return properties


def _add_texture(
    line: str, path: tuple[str, ...], properties: dict[str, Any], surface: dict[str, Any], folder: _Folder, beside: str
) -> None:
    found = texture_line(line)
    if found is None:
        return
    texture: dict[str, Any] = {"index": folder.texture(found.name, beside)}
    transform = {
        word: (numbers + default[len(numbers) :])[:2]
        for option, word, default in (("-o", "offset", [0.0, 0.0]), ("-s", "scale", [1.0, 1.0]))
        if (numbers := _numbers(found.options.get(option, ())))
    }
    if transform:
        texture["extensions"] = {"KHR_texture_transform": transform}
    (surface if len(path) > 1 else properties)[path[-1]] = texture


def _numbers(words: Sequence[str]) -> list[float]:
    """The words as finite numbers; none if one is no such."""
    try:
        numbers = [float(word) for word in words if "_" not in word]
    except ValueError:
        return []
    return numbers if len(numbers) == len(words) and np.isfinite(numbers).all() else []
