"""Mesh files, read and written: OBJ, PLY, OFF, STL, GLB and glTF by readers and writers of our own, others by trimesh.

Faces and vertex order are taken as they stand in the file: nothing is merged or repaired. Each format is a package of
its own; its reader holds what a file declares against its bytes and the limits before it takes memory.
"""

from meshtide_codec.mesh_files.read import is_mesh_path, load_mesh, load_scene, mesh_of
from meshtide_codec.mesh_files.write import save_mesh, save_scene

__all__ = ["is_mesh_path", "load_mesh", "load_scene", "mesh_of", "save_mesh", "save_scene"]
