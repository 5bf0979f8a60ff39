"""Section 5 of the paper, run again on any meshes: rates, errors, norms, pictures, and a report of them.

It may import `link` (for noise on Diffs) and meshtide_codec, whose `rendering` draws the pictures.
"""
