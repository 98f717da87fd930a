"""The published rule, run faithfully: Yper, Hammerstein identification, table 2."""
