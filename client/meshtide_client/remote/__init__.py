"""What a server hosts, seen and changed from afar: listing and searching, editing and deleting, ingesting many files.

Ingesting also finds those files, and hands them to a store where there is no server. It may import `connection` and
meshtide_codec.
"""
