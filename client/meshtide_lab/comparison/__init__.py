"""How meshtide compares with Draco, and with a ladder of simplified Draco files: `meshtide compare`.

It may import meshtide_codec, whose `report` has states, curves and how they are drawn.
"""
