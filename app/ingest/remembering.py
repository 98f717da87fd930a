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
            alone = len(asked) == 1  # names are, by the 100,000
            characters = _characters(*asked) if alone else sum(map(_characters, asked))
            return kept(*asked) if characters <= longest else ask(*asked)

        return answered

    return keeping


def _characters(asked: object) -> int:
    if isinstance(asked, str):
        return len(asked)
    return sum(map(len, asked)) if isinstance(asked, tuple) else 0
