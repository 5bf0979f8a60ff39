"""Which extensions of glTF are understood: a file that requires another one is refused by its name.

Those of looks, lights and the like change nothing of the geometry; they are kept unchanged.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf.document import names

if TYPE_CHECKING:
    from meshtide_codec.mesh_files.gltf.document import Document

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
INSTANCING = "EXT_mesh_gpu_instancing"
QUANTIZATION = "KHR_mesh_quantization"
GEOMETRIC = frozenset({DRACO, *MESHOPT, INSTANCING, QUANTIZATION})
"""These say how geometry is stored; what is read no longer has them."""
_VISUAL = frozenset(
    {
        "ADOBE_materials_thin_transparency",
        "EXT_instance_features",
        "EXT_lights_ies",
        "EXT_lights_image_based",
        "EXT_mesh_features",
        "EXT_structural_metadata",
        "EXT_texture_avif",
        "EXT_texture_webp",
        "KHR_animation_pointer",
        "KHR_lights_punctual",
        "KHR_node_hoverability",
        "KHR_node_selectability",
        "KHR_node_visibility",
        "KHR_texture_basisu",
        "KHR_texture_transform",
        "KHR_xmp",
        "KHR_xmp_json_ld",
        "MSFT_texture_dds",
    }
)
_VISUAL_FAMILY = "KHR_materials_"


def check_required(document: Document) -> None:
    """Refuse a file that nobody may read who does not know some extension.

    Raises:
        MeshFileError: it requires one that is not known here; the message names it.
    """
    unknown = [name for name in names(document.root, "extensionsRequired") if not is_known(name)]
    if unknown:
        listed = ", ".join(ascii(name[:80])[1:-1] for name in unknown[:5])
        raise MeshFileError(f"the file requires {listed}, which is not known here; save it without")


def is_known(name: str) -> bool:
    """Whether an extension is understood, or changes nothing of the geometry.

    >>> is_known("KHR_materials_clearcoat"), is_known("EXT_not_known")
    (True, False)
    """
    return name in GEOMETRIC or name in _VISUAL or name.startswith(_VISUAL_FAMILY)


def is_required(document: Document, name: str) -> bool:
    """Whether the file cannot be read without an extension."""
    return name in names(document.root, "extensionsRequired")
