"""Which columns of a table hold times, tags, values and qualities."""
