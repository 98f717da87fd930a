"""What of a column's name is the same however it is written."""

import re
from collections.abc import Sequence

from app.ingest.remembering import remembered
from app.ingest.tags.grouping import spelled_out

_MAY_BE_LETTER = re.compile("[A-Za-z\x80-\U0010ffff]").search
"""Signs such as № are spelled out in letters."""


@remembered(1 << 17)
def plain(name: str) -> str:
    """Letters and digits of a name, in small letters without accents; empty where it has none outside of brackets."""
    return re.sub(r"[\W_]", "", re.sub(r"[\[(][^\[(\])]*[\])]", "", spelled_out(name.lower())))


def words_in(row: Sequence[str]) -> dict[int, str]:
    """By column, the cells that may be words. The others, which are most of a row of data, name nothing: neither are
    they plain names that are known nor do they tell a signal."""
    return {index: cell for index, cell in enumerate(row) if _MAY_BE_LETTER(cell)}


def first_of_each(words: dict[int, str]) -> dict[str, int]:
    """By plain name, the first column that has it. words: by column, in their order."""
    return {plain(word): index for index, word in reversed(words.items())}
