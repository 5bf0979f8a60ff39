"""What is hosted and where its bytes lie: the folder's meshes and the published ones, their streams, packets, caches.

Answers which mesh has an id, which meshes a query is about, and which bytes a range of a stream has. May import
`catalogue/`, `store/` and `operations/`; it knows no HTTP, and nothing of how a mesh becomes a stream.
"""
