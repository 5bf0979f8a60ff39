"""A second decoder, written from docs/format.md for reading: plain Python, one step of the format in each file.

It shares no decoding code with the rest of the package and is held against it bit for bit by the tests, so that the
document, the kernels and this decoder tell the same story. It reads whole, undamaged streams, and takes a second or
so for every thousand vertices.
"""

from meshtide_codec.reference.decoder import reference_decode
from meshtide_codec.reference.order import reference_order

__all__ = ["reference_decode", "reference_order"]
