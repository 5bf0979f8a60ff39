"""Profile classic: Balan & Taubin 2000, complete. For study, for the paper's tables, for robustness experiments."""
