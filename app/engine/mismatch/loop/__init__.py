"""The loop that is simulated: its record, its process, the controller's law, pieces of physics in a chain."""
