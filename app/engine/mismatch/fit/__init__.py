"""A free run fitted to PV under coloured noise, the linear loop behind a simulation, quick scans and stems."""
