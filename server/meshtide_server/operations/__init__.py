"""What those who run the server look at: its log and what must not get into it, its metrics, whether it is ready.

Every other room may write a line or count something. May import the settings and, to ask whether it answers, `store/`.
"""
