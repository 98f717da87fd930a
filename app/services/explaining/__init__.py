"""Recording against simulation: asked for, worked out by a worker, told as line, plot and words."""
