"""Confidences in a value, in percent, as PHD has them."""

import polars as pl

_SURE, _UNSURE = 100.0, 50.0


def of_confidences(texts: pl.Series) -> pl.Series:
    """As words of qualities: below 100 uncertain, from 50 down bad. What is no number stays."""
    number = pl.col("text").str.strip_chars(' "').cast(pl.Float64, strict=False)
    word = (
        pl.when(number >= _SURE)
        .then(pl.lit("good"))
        .when(number > _UNSURE)
        .then(pl.lit("uncertain"))
        .when(number.is_not_null())
        .then(pl.lit("bad"))
        .otherwise(pl.col("text"))
    )
    return texts.alias("text").to_frame().select(word.alias("word")).to_series()
