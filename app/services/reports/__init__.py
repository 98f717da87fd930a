"""A loop or the plant as one document that opens anywhere."""
