"""The rows of long and wide tables to signals and loops, chunk by chunk."""
