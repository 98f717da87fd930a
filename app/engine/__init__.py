"""The pure engine: recording -> audit, recording + simulation -> explanation."""

ENGINE_VERSION = "0.1.20"
"""Stored with all that the engine says: other answers are another version (`tests/golden/answers.py` raises it)."""
