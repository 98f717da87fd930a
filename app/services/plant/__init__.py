"""What people look at: the plant, its table, its loops, their trends, charts and groups."""
