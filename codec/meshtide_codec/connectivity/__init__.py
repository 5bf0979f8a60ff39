"""To be written."""

from meshtide_codec.connectivity.codec import decode_faces, encode_faces

__all__ = ["decode_faces", "encode_faces"]
