"""PLY, as text and in both binary forms: read into a scene, and written from one.

Format: G. Turk, "The PLY Polygon File Format" (1994), and the properties that programs have added (`attributes`).
"""

from meshtide_codec.mesh_files.ply.read import read_ply
from meshtide_codec.mesh_files.ply.write import write_ply

__all__ = ["read_ply", "write_ply"]
