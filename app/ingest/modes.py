"""Modes of a controller, in words or numbers, to automatic or not."""

import numpy as np
import polars as pl

from app.ingest.model import FloatArray
from app.ingest.stamps import to_numbers

AUTOMATIC = frozenset(
    [
        "auto",
        "aut",
        "a",
        "automatic",
        "automatik",
        "cas",
        "cascade",
        "casc",
        "rcas",
        "remcas",
        "rmt",
        "remote",
        "bcas",
        "pauto",
        "prd",
        "1",
        "true",
        "on",
    ]
)
MANUAL = frozenset(
    [
        "man",
        "m",
        "manual",
        "hand",
        "rout",
        "iman",
        "lo",
        "oos",
        "o/s",
        "tracking",
        "trk",
        "track",
        "init",
        "0",
        "false",
        "off",
    ]
)


def automatic_flags(texts: pl.Series) -> FloatArray:
    """(n,) 1 for automatic or cascade, 0 for manual, NaN where nothing or nothing known stands there. A number is
    automatic unless 0."""
    numbers = to_numbers(texts)
    flags = flags_of_numbers(numbers)
    rest = np.isnan(flags)
    if np.any(rest):
        words = texts.str.strip_chars(' "').str.to_lowercase()
        flags[words.is_in(sorted(AUTOMATIC)).fill_null(False).to_numpy()] = 1.0
        flags[words.is_in(sorted(MANUAL)).fill_null(False).to_numpy()] = 0.0
    return flags


def flags_of_numbers(numbers: FloatArray) -> FloatArray:
    return np.where(np.isfinite(numbers), (numbers != 0).astype(np.float64), np.nan)
