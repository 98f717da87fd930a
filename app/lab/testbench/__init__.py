"""Simulated loops whose truth is known: what the verdict learns from, and a bench that varies one factor at a time."""
