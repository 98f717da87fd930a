"""What foretells PV beyond its own past: OP, or the stem of a valve that sticks (Granger's causality)."""
