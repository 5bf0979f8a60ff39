"""glTF 2.0, as GLB or as JSON with files beside it: read into a scene, and written from one.

Format: Khronos, "glTF 2.0 Specification", and the extensions that `extensions` names.
"""

from meshtide_codec.mesh_files.gltf.read import read_gltf
from meshtide_codec.mesh_files.gltf.write import write_gltf

__all__ = ["read_gltf", "write_gltf"]
