"""Who may do what: keys, sessions, roles, rates, and the trail of what was done."""
