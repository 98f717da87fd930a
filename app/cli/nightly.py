def nightly() -> None:
    """Later."""
