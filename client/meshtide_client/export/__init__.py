"""Meshes written as a folder of `.tide` files that any web server can host.

They come from files, servers and buckets: it may import `download`, `remote`, `connection` and meshtide_codec.
"""
