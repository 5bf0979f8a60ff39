"""Who may do what, and how much of it: tokens, one-time tickets, origins of pages, limits of a client, token buckets.

Plain rules without sockets or frameworks; the layers in `http/` ask them. May import the settings and refusals, no
other room.
"""
