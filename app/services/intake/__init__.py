"""Exports as they come in: received and synced, then read by a worker."""
