"""Training and measuring the verdict: simulated loops, leave-one-valve-out, the report."""
