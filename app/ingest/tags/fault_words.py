"""Words that say what is wrong with a value, or that another stands in its place: `Sensor failure`, `Drahtbruch`."""

import polars as pl

_WHOLE = (
    *("bad", "err", "nok", "not ok", "not valid", "no (signal|data|value|sample|result)", "off-?line", "on hold"),
    *("stale", "held", "frozen", "lost", "loss", "time-?out", "questionable", "doubtful", "suspect", "forced"),
    *("(over|under|out of|sub)[ -]?(range|normal)", "(wire|open|short|broken) ?(break|circuit|wire)"),
    *("last (known|good) value", "manual entry", "shut ?down", "(out of|hors) service", "au(ß|ss)er betrieb"),
    "keine? (signal|wert|daten)",
)
_BEGINS = (
    *("fail", "fault", "error", "invalid", "unavail", "unreliab", "uncertain", "unknown", "undefined", "disconn"),
    *("not? avail", "not? conn", "no comm", "substitut", "simul", "saturat", "bypass", "calib", "mainten", "erreur"),
    *("défaut", "defaut", "défaill", "defaill", "incertain", "nicht verf", "nicht gültig", "ersatzwert", "handwert"),
    *("defe[ck]t", "wartung", "kalib", "ошибк", "недост", "обрыв", "отказ"),
)
_WITHIN = (
    *("fehler", "störung", "stoerung", "gestört", "gestoert", "ausfall", "ausgefallen", "drahtbruch", "kabelbruch"),
    *("leitungsbruch", "kurzschluss", "ungültig", "ungueltig", "unsicher", "故障", "错误", "无效", "断线"),
)
"""Parts of longer words."""
_FAULTS = rf"(?i)\b({'|'.join(_WHOLE)})\b|\b({'|'.join(_BEGINS)})|{'|'.join(_WITHIN)}"


def tell_faults(texts: pl.Series) -> pl.Series:
    """(n,) bool."""
    return texts.str.contains(_FAULTS).fill_null(False)
