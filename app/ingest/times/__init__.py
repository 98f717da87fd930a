"""Time stamps in all their spellings, to nanoseconds since 1970 UTC, and their order."""
