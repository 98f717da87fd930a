"""Versions of the data base's schema, applied by `loopaudit migrate`."""
