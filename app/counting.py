"""How many of what, in words: one sample, two samples, 3,000 samples."""


def counted(count: int, one: str, several: str = "") -> str:
    """`counted(1, "sample")` is "1 sample", of 2 it is "2 samples"; `several` where an s at the end is not all: with a
    verb, as in `counted(n, "row has", "rows have")`."""
    return f"{count:,} {one if count == 1 else several or f'{one}s'}"


def counted_times(count: int) -> str:
    """ "once", "3 times"."""
    return "once" if count == 1 else f"{count:,} times"


def megabytes(size: float) -> str:
    return f"{size / 1e6:,.0f} MB".replace(",", " ")
