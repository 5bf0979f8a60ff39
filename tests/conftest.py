"""Settings of all tests."""

from __future__ import annotations

from hypothesis import settings

# A busy machine may take seconds for an example.
settings.register_profile("meshtide", deadline=None)
settings.load_profile("meshtide")
