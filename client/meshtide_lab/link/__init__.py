"""Models of lossy links: what they do to the packets of a stream, planned from its header and a seed (Sans-I/O).

A `LossyLink` is a chain of models and a seed. Its plan for a stream gives the fate of every packet: lost or not, when
it arrives on a virtual clock, which of its bits are flipped, which noise its Diffs get. The plan needs nothing but
the header's packet table, so it is the same for a stored stream and for one that is on its way. `fidelity` measures
what is left. It may import meshtide_codec, and the protocols of `meshtide_client.download.packet_filter`.
"""
