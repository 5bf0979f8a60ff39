"""meshtide client."""
