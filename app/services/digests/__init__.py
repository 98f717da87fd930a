"""What the night found, on its way to those who want to be told."""
