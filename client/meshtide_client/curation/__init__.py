"""Looking after the meshes of a server: changing what is told of one, taking one away, seeing which tags there are."""
