"""meshtide server."""
