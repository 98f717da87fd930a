"""Audit runs from their plan to the stored verdict, and the audit line."""
