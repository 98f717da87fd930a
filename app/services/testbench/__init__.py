"""The simulated test bench: whole audits of loops whose truth is known, along one factor at a time."""
