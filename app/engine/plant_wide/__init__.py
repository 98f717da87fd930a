"""Loops heard beside each other: which swing together, which move the set point of another."""
