"""What the bytes of a stream are spent on, and what can be seen after how many: `encode --report`.

It may import the modules of meshtide_codec that decode and describe streams; only the command `encode` and the
laboratory import it.
"""
