"""Versions of the database's schema, applied by `loopaudit migrate`."""
