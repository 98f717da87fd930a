"""Numbers as files write them: marks, blanks, units, and what stands for no data."""
