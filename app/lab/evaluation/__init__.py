"""Training and measuring the verdict: leave-one-valve-out, its figures, the report."""
