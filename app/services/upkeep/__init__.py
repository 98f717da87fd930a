"""The service's own health: schema, sweeper, backup, retention, doctor, metrics."""
