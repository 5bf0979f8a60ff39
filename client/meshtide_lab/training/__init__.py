"""Meshes made ready for the training of the states that coders start from: `make core-train`.

It may import meshtide_codec.
"""
