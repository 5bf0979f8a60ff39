"""The stream: packets, header, container file, wire messages, and the streaming session (Sans-I/O)."""
