"""Answers about names, words and columns that come again and again, remembered from file to file."""

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import TypeVar, TypeVarTuple

LONGEST = 256  # characters of what is remembered: longer cells would stay in memory behind their file, by the megabyte
_Asked = TypeVarTuple("_Asked")
_Answer = TypeVar("_Answer")


def remembered(
    most: int, longest: int = LONGEST
) -> Callable[[Callable[[*_Asked], _Answer]], Callable[[*_Asked], _Answer]]:
    """Of a function of texts, or of tuples of texts: its `most` last answers to such as have at most `longest`
    characters together are kept.
    """

    def keeping(ask: Callable[[*_Asked], _Answer]) -> Callable[[*_Asked], _Answer]:
        kept = lru_cache(maxsize=most)(ask)

        @wraps(ask)
        def answered(*asked: *_Asked) -> _Answer:
            characters = 0
            for one in asked:  # without a call: names are asked by the 100,000
                if isinstance(one, str):
                    characters += len(one)
                elif isinstance(one, tuple):
                    characters += sum(map(len, one))
            return kept(*asked) if characters <= longest else ask(*asked)

        return answered

    return keeping
