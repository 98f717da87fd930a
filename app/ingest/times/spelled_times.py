"""Stamps as people and regional settings spell them, in the spelling that `stamps` reads: names of months in full and
in other languages, `a.m.`, narrow blanks, a comma before the clock or before the decimals of its seconds, UTC or GMT in
letters, the signs for year, month and day."""

from types import MappingProxyType

import polars as pl

_ENGLISH = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_NAMES = (
    "january february march april may june july august september october november december",
    "- - - - - - - - sept - - -",
    "januar februar märz april mai juni juli august september oktober november dezember",
    "jänner feber mär - - - - - - okt - dez",
    "- - mrz - - - - - - - - -",
    "- - maerz - - - - - - - - -",
    "janvier février mars avril mai juin juillet août septembre octobre novembre décembre",
    "janv févr - avr - - juil aoû - - - déc",
    "- fevrier - - - - - aout - - - decembre",
    "enero febrero marzo abril mayo junio julio agosto septiembre octubre noviembre diciembre",
    "ene - - abr - - - ago setiembre - - dic",
    "gennaio febbraio marzo aprile maggio giugno luglio agosto settembre ottobre novembre dicembre",
    "gen - - - mag giu lug - set ott - -",
    "janeiro fevereiro março abril maio junho julho agosto setembro outubro novembro dezembro",
    "- fev - - - - - - - out - -",
    "januari februari maart april mei juni juli augustus september oktober november december",
    "- - mrt - - - - - - - - -",
)
"""English, German, French, Spanish, Italian, Portuguese and Dutch, in full and as regional settings shorten them."""
MONTHS = MappingProxyType(
    {short: short.title() for short in _ENGLISH}
    | {
        name: short.title()
        for names in _NAMES
        for name, short in zip(names.split(), _ENGLISH, strict=True)
        if name != "-"
    }
)
_MONTH = rf"({'|'.join(sorted(MONTHS, key=len, reverse=True))})\.?"
_WEEKDAY = r"^(?:[^\W\d_]{2,}\.?,? )?"
_BETWEEN = r"[ .\-/]*"
_DAY = r"(\d{1,2})(?:\.|st|nd|rd|th|er|º)?"
_REST = r"(?:[ ,:T]+(\S.*))?$"
_DATES = (
    (rf"(?i){_WEEKDAY}{_DAY}{_BETWEEN}(?:de )?{_MONTH}[ .\-/,]*(?:del? )?(\d{{4}}|\d\d)", (0, 1, 2)),
    (rf"(?i){_WEEKDAY}{_MONTH}{_BETWEEN}{_DAY}[ .\-/,]+(\d{{4}})", (1, 0, 2)),
    (rf"(?i)^(\d{{4}}){_BETWEEN}{_MONTH}{_BETWEEN}(\d{{1,2}})", (2, 1, 0)),
)
"""Forms of dates with where day, month and year stand in them."""
_UTC = "(?:UTC|GMT)"
OFFSETS_OF_LETTERS = MappingProxyType(
    {
        **dict.fromkeys(("CET", "MEZ", "WEST"), "+01:00"),
        **dict.fromkeys(("CEST", "MESZ", "EET"), "+02:00"),
        **{"WET": "+00:00", "EEST": "+03:00", "EDT": "-04:00", "EST": "-05:00", "CDT": "-05:00"},
        **{"MDT": "-06:00", "MST": "-07:00", "PDT": "-07:00", "PST": "-08:00"},
    }
)
"""Zones in letters that mean one offset wherever they are used; CST, IST and BST do not."""
ZONES_IN_LETTERS = tuple(OFFSETS_OF_LETTERS)
_IN_LETTERS = rf":\d{{2}}(?:\.\d+)? (?:{'|'.join(OFFSETS_OF_LETTERS)})$"
_OF_DIGITS = (
    (r"(:\d{2}(?:\.\d+)?) ([+-]\d{2}):?(\d{2})$", "${1}${2}:${3}"),
    (r"(\d:\d{2}:\d{2})[:;](\d{3})$", "${1}.${2}"),
    (r"^((?:19|20)\d{6})(\d{2})(\d{2})$", "${1} ${2}:${3}"),
    (r"^((?:19|20)\d{12})(\d{3})$", "${1}.${2}"),
)
"""All that is done to stamps of digits and their usual signs, as ISO 8601 has them."""
_OTHER_SIGNS = r"[^0-9TZ :;.+/-]"
_MADE_PLAIN = (
    (
        r"(?i)^[a-z]{3} ([a-z]{3}) (\d{1,2}) (\d{1,2}:\d{2}:\d{2})((?: \S+)?) (\d{4})$",
        "${1} ${2} ${5} ${3}${4}",
    ),  # Java
    (r"(?i) (\d{1,2})\.(\d{2})\.(\d{2})((?:\.\d+)?) ?([ap]m)$", " ${1}:${2}:${3}${4} ${5}"),
    *_OF_DIGITS,
    (r"(?i)(\d)(?:,|,? (?:at|um|à|a las)) ?(\d{1,2}:\d{2})", "${1} ${2}"),
    (r"(:\d{2}),(\d)", "${1}.${2}"),
    (r"^(\d{4})年(\d{1,2})月(\d{1,2})日", "${1}-${2}-${3}"),
    (r"(\d{1,2})[时時](\d{1,2})分(\d{1,2})秒", "${1}:${2}:${3}"),
    (r"(?i)(\d) ?(?:上午|午前|오전|πμ|π\.μ\.)$", "${1} am"),
    (r"(?i)(\d) ?(?:下午|午後|오후|μμ|μ\.μ\.)$", "${1} pm"),
    (r"(?:上午|午前|오전) ?(\d{1,2}:\d{2}\S*)$", "${1} am"),
    (r"(?:下午|午後|오후) ?(\d{1,2}:\d{2}\S*)$", "${1} pm"),
    (r"(?i)(\d) ?([ap])\.? ?m\b\.?", "${1} ${2}m"),
    (r"(?i)(:\d{2}) ?(?:uhr|hrs?)$", "${1}"),
    (r"([+-]\d{2}:\d{2}|Z)\[[A-Za-z_/]+\]$", "${1}"),
    (rf"({_UTC}[+-]\d{{4}}) \([A-Za-z ]+\)$", "${1}"),
    (rf"(?i) ?\(?{_UTC}\)?$", "+00:00"),
    (rf"(?i) ?\(?{_UTC} ?([+-])(\d)(:?\d{{2}})?\)?$", "${1}0${2}${3}UTC"),
    (rf"(?i) ?\(?{_UTC} ?([+-]\d{{2}}):?(\d{{2}})?\)?$", "${1}${2}UTC"),
    (r"([+-]\d{2})UTC$", "${1}:00"),
    (r"([+-]\d{2}):?(\d{2})UTC$", "${1}:${2}"),
)


def respelled(texts: pl.Series) -> pl.Series:
    """Stamps in the usual spelling; named months as 12-Nov-2026; texts that are none come back as anything."""
    texts = texts.str.replace_all(r"\s+", " ").str.strip_chars(' "')
    of_digits = not texts.str.contains(_OTHER_SIGNS).any()
    for pattern, plain in _OF_DIGITS if of_digits else _MADE_PLAIN:
        texts = texts.str.replace(pattern, plain)
    if of_digits:  # the forms below, most of whose cost is that they are compiled, have words
        return texts
    if texts.str.contains(_IN_LETTERS).any():
        for letters, offset in OFFSETS_OF_LETTERS.items():
            texts = texts.str.replace(rf"(:\d{{2}}(?:\.\d+)?) {letters}$", f"${{1}}{offset}")
    for pattern, order in _DATES:
        texts = _with_named_month(texts, pattern + _REST, order)
    return texts


def tells_utc(texts: pl.Series) -> bool:
    """Whether a zone stands behind stamps in letters."""
    return bool(texts.str.contains(rf"(?i){_UTC}\)?$|{_UTC} ?[+-]\d").any())


def _with_named_month(texts: pl.Series, pattern: str, order: tuple[int, int, int]) -> pl.Series:
    parts = texts.str.extract_groups(pattern).struct.unnest()
    day, month, year = (parts.to_series(index) for index in order)
    if month.null_count() == len(month):
        return texts
    short = month.str.to_lowercase().replace_strict(MONTHS, default=None, return_dtype=pl.String)
    date = pl.select(pl.concat_str(day, short, year, separator="-")).to_series()
    stamp = pl.select(pl.concat_str(date, parts.to_series(3), separator=" ", ignore_nulls=True)).to_series()
    return stamp.zip_with(date.is_not_null(), texts)
