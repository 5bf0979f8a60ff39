"""What every way to a server or a file has in common: addresses, tokens, trusted certificates, and what a refusal says.

Nothing here opens a connection. It may import meshtide_codec, and nothing of the client.
"""
