"""The routes, one module for each group of addresses.

Each states what it takes and answers, and asks the other rooms for it. May import what `http/` may.
"""
