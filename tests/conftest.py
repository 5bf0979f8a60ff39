"""Settings of all tests."""

from __future__ import annotations

import signal

from hypothesis import settings

# A shell that starts the tests in the background has SIGINT ignored, and so would every process that they interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# A busy machine may take seconds for an example.
settings.register_profile("meshtide", deadline=None)
settings.load_profile("meshtide")
