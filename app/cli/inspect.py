def inspect() -> None:
    """Later."""
