"""The door: routes and what they say, the layers around them, and the websocket of a stream.

Everything that knows requests, answers and frames is here, and nothing else. May import every room but `bulk_ingest/`,
and is imported by the application (`app`, `serving`) only.
"""
