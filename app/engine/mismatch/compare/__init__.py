"""What is compared: recording and simulation checked, thinned and made ready, and what PV shows by itself."""
