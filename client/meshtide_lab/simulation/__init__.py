"""`meshtide simulate`: sweeps of streams over lossy links, many seeds each, and what is left of the meshes.

It may import `link`, meshtide_client (for meshes on servers) and meshtide_codec.
"""
