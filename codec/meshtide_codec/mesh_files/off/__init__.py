"""OFF, as text and binary, with all its prefixes: read into a scene, and written from one.

Format: Geomview manual, "OFF: Object File Format".
"""

from meshtide_codec.mesh_files.off.read import read_off
from meshtide_codec.mesh_files.off.write import write_off

__all__ = ["read_off", "write_off"]
