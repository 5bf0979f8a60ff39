"""Settings of all tests."""

from __future__ import annotations

from hypothesis import settings

# The first example of a test may compile kernels, which takes seconds.
settings.register_profile("meshtide", deadline=None)
settings.load_profile("meshtide")
