"""Answers about names and words that come again and again, remembered from file to file."""

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import TypeVar

LONGEST = 256  # characters of what is remembered: longer cells would stay in memory behind their file, by the megabyte
_Answer = TypeVar("_Answer")


def remembered(most: int) -> Callable[[Callable[[str], _Answer]], Callable[[str], _Answer]]:
    """Of a function of a text: its answers to the `most` last short ones are kept."""

    def keeping(ask: Callable[[str], _Answer]) -> Callable[[str], _Answer]:
        kept = lru_cache(maxsize=most)(ask)

        @wraps(ask)
        def answered(text: str) -> _Answer:
            return kept(text) if len(text) <= LONGEST else ask(text)

        return answered

    return keeping
