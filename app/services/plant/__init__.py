"""What people look at: the plant, its table, its loops' verdicts, their trends, charts and groups."""
