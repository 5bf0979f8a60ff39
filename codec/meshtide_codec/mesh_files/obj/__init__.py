"""Wavefront OBJ with its MTL materials: read into a scene, and written from one.

Format: "Object Files (.obj)", Wavefront Advanced Visualizer manual, appendix B1; "MTL material format", the same, 5.
"""

from meshtide_codec.mesh_files.obj.read import read_obj
from meshtide_codec.mesh_files.obj.write import write_obj

__all__ = ["read_obj", "write_obj"]
