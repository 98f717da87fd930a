"""The best of some points, none of them nearly another."""

from collections.abc import Callable, Iterable
from typing import TypeVar

T = TypeVar("T")


def unlike_better_ones(best_first: Iterable[T], nearly_one: Callable[[T, T], bool], most: int | None = None) -> list[T]:
    """Each that is not nearly one with a better one that was kept, the best first, `most` at most."""
    kept: list[T] = []
    for one in best_first:
        if not any(nearly_one(one, other) for other in kept):
            kept.append(one)
            if len(kept) == most:
                break
    return kept
