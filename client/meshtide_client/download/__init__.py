"""From an address to meshes: a stream arrives over a websocket or as a file, is kept, and is decoded level by level.

`fetch` waits for a mesh, `stream` gives level after level; both are a `Download`, which gets its bytes through
`Attempts`, over as many connections and transports as it takes. It may import `connection` and meshtide_codec.
"""
