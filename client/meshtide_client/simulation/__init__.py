"""`meshtide simulate`: sweeps of streams over lossy links, many seeds each, and what is left of the meshes."""
