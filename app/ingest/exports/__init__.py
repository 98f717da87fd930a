"""An export as a whole, whatever kind of file it is: its loops, what was refused, what it holds."""
