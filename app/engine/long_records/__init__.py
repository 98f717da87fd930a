"""Records of days: the stretch that speaks for them, and episodes that are dated."""
