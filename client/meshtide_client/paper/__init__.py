"""Section 5 of the paper, run again on any meshes: rates, errors, norms, pictures, and a report of them."""
