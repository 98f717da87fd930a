"""What a tag is: which loop and signal its name says, and what its modes and qualities mean."""
