"""Pages for people, rendered on the server; scripts, styles and charts come from this service only."""
