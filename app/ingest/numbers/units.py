"""Units behind numbers in one field, as `36.4 %` or `12,3 °C`: the number is read, its unit told."""

import re
import unicodedata
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import polars as pl

from app.ingest.model import FloatArray
from app.ingest.telling import tags_by
from app.ingest.times.time_reader import to_numbers

# As they stand but for case and blanks. No single letters: behind a value they may be a mark of its quality.
_SPELLED = """
    % ‰ vol% wt% mol% %rh ppm ppb ph
    ° °c °f degc degf ℃ ℉
    pa hpa kpa mpa kpag kpaa mpag mpaa bar barg bara mbar mbarg mbara psi psig psia torr atm
    mmhg mmh2o mmwc inhg inh2o inwc kg/cm2 kg/cm² kgf/cm2 kgf/cm² kg/cm2g kg/cm2a
    m3/h m³/h m3/hr m³/hr m3/min m³/min m3/s m³/s m3/d m³/d nm3/h nm³/h nm3/hr nm³/hr sm3/h sm³/h sm3/d sm³/d
    l/h l/min l/s lpm lph gpm gph scfh scfm mscfd mmscfd bpd bph bbl/d bbl/h
    kg/h kg/hr kg/min kg/s t/h t/hr t/d tph lb/h lb/hr klb/h
    mm cm in inch ft m3 m³ kg
    ma mv kv kw mw gw kwh mwh gj/h mj/h kj/kg hz rpm u/min min-1 m/s mm/s
    kg/m3 kg/m³ g/cm3 g/cm³ g/l mg/l cp cst us/cm µs/cm ms/cm ntu
"""
UNITS = frozenset(_SPELLED.split())
_WITH_UNIT = r"^([+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?)\s*([^\d\s].*)$"
_FIELD = re.compile(_WITH_UNIT)
_MINUS_BEHIND = re.compile(r"\d+([.,]\d+)?-$")  # as SAP writes it
_PLAIN = str.maketrans({"°": "deg", **dict.fromkeys("[]().^")})
_OF_AN_HOUR = re.compile("/(?:hr|hour)$")
_SHORT = ("k", "mil", "bil", "tri")
"""As Grafana writes thousands, millions and what follows them."""
_NO_UNIT = dict.fromkeys(("null", "none", "na", "n/a"), "")
_NAMED = _NO_UNIT | {"pct": "%", "percent": "%", "c": "degc", "celsius": "degc", "f": "degf", "fahrenheit": "degf"}


class UnitsOfTags:
    """The unit behind the numbers of each tag, as most of those have it that come first: a number in another one is
    none of the same quantity. of: units that are known before."""

    def __init__(self, of: Mapping[str, str] | None = None) -> None:
        self.of: dict[str, str] = dict(of or {})
        self._times: dict[str, Counter[str]] = {}  # by tag, how often it has each unit
        self._others: dict[str, str] = {}
        self._shortened: dict[str, str] = {}

    def read(self, texts: pl.Series, tags: pl.Series) -> FloatArray:
        """(n,) numbers of texts that have their tag's unit behind them, NaN elsewhere."""
        parts = texts.str.strip_chars(' "').str.extract_groups(_WITH_UNIT).struct.unnest()
        numbers, units = parts.to_series(0), parts.to_series(1)
        self._look_for_shortened(units, tags)
        units = units.set(~are_units(units), None)
        given = pl.DataFrame([tags.alias("tag"), units.alias("unit")]).drop_nulls()
        counted = given.group_by("tag", "unit", maintain_order=True).len()
        for tag, unit, times in counted.sort("len", descending=True, maintain_order=True).iter_rows():
            self._times.setdefault(tag, Counter())[unit] += times
            if self.of.setdefault(tag, unit) != unit:
                self._others.setdefault(tag, unit)
        same = units == tags.replace_strict(self.of, default=None, return_dtype=pl.String)
        return np.where(same.fill_null(False).to_numpy(), to_numbers(numbers), np.nan)

    def of_most(self) -> dict[str, str]:
        """By tag, the unit that most of all its numbers have that were read; of equal ones the earlier."""
        return {tag: times.most_common(1)[0][0] for tag, times in self._times.items()}

    def in_per_cent(self, tag: str) -> int:
        """How many of a tag's numbers have a % behind them."""
        return self._times[tag]["%"] if tag in self._times else 0

    @property
    def is_settled(self) -> bool:
        """Whether each tag's is that of most of all its numbers."""
        return self.of_most().items() <= self.of.items()

    def _look_for_shortened(self, units: pl.Series, tags: pl.Series) -> None:
        short = units.str.strip_chars().str.to_lowercase().is_in(_SHORT).fill_null(False)
        if short.any():
            found = pl.DataFrame([tags.alias("tag"), units.str.strip_chars().alias("unit")]).filter(short)
            for tag, unit in found.unique("tag", maintain_order=True).iter_rows():
                self._shortened.setdefault(tag, unit)

    def notes(self, order: Sequence[str] = ()) -> list[str]:
        """The units and some of the tags that have them, and those that were refused. order: that of the tags."""
        told = {
            "numbers have their unit behind them, and were read where it is the one of their tag": self.of,
            "numbers are in another unit than most of their tag, and were refused": self._others,
            "numbers that may be rounded thousands or millions, or kelvin, were refused, send them unformatted": (
                self._shortened
            ),
        }
        return [f"{what}: {_shown(units, order)}" for what, units in told.items() if units]


def _shown(units: Mapping[str, str], order: Sequence[str]) -> str:
    return "; ".join(f"{unit} ({tags})" for unit, tags in tags_by(units, order).items())


def is_unit(text: str) -> bool:
    return "".join(text.lower().split()) in UNITS


def plain_unit(text: str) -> str:
    """A unit as others may write it: m³/h and m3/hr, °C and degC, barg and bar(g); empty for a word that says that
    none is known. "-" is one of its own, that of shares: 0.5, not 50 %."""
    shown = unicodedata.normalize("NFKC", text.replace("º", "°")).lower()
    plain = "".join(shown.split()).translate(_PLAIN)
    return _NAMED.get(plain, _OF_AN_HOUR.sub("/h", plain))


def are_units(texts: pl.Series) -> pl.Series:
    return texts.str.to_lowercase().str.replace_all(r"\s", "").is_in(sorted(UNITS))


def without_unit(field: str) -> str:
    """The number of a field that has a unit, or its minus, behind it; other fields as they are."""
    if field[-1:] == "-" and _MINUS_BEHIND.match(field):
        return "-" + field[:-1]
    found = None if field[-1:].isdigit() else _FIELD.match(field)
    return found[1] if found and is_unit(found[2]) else field


def as_number(field: str) -> float:
    """Of a field that is a number, with a point or a comma before its decimals, perhaps with its unit behind it."""
    return float(without_unit(field).replace(",", "."))
