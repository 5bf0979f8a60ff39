"""Pictures of meshes without a screen: rasterizer, colour scales, lettering, PNG files.

Whoever has meshes draws with it: the command `render`, the demonstration, the laboratory. It may import the modules of
meshtide_codec that read meshes and streams; none of those imports it.
"""
