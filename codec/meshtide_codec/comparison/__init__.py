"""What a stream's bytes are spent on, and how meshtide compares with its peers: reports, tables and plots."""
