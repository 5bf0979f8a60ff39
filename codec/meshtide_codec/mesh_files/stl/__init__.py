"""STL, as text and binary: read into a scene, and written from one.

Format: 3D Systems, "StereoLithography Interface Specification" (1989).
"""

from meshtide_codec.mesh_files.stl.read import read_stl
from meshtide_codec.mesh_files.stl.write import write_stl

__all__ = ["read_stl", "write_stl"]
