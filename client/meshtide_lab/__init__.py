"""The laboratory of meshtide: what is measured, compared and run again, above client and codec.

`link` harms packets, `simulation` sweeps streams over such links, `paper` runs the paper's experiments again,
`comparison` measures meshtide beside Draco, `training` prepares meshes for the trained states. It may import
meshtide_client and meshtide_codec; neither imports it: its commands, and the lossy link of `meshtide fetch --loss`, are
found by their entry points.
"""
