"""Simulated loops whose truth is known: those the verdict learns from, and the bench that audits others one factor at a time."""
