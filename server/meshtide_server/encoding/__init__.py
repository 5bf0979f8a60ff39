"""How a mesh becomes a stream: the encoder's process, uploads that wait for it, and the jobs that are worked on.

`worker` is the process itself, `process` and `pool` are its owner's side, `runner` and `attempt` work off the
catalogue's jobs. May import `hosting/`, `catalogue/`, `store/` and `operations/`; it knows no HTTP.
"""
