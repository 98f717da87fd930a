"""The loop and the signal of a tag: by the ending of its name, by the letters of ISA, or by a mapping that the plant
gives."""

import json
import math
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

from app.errors import DataError
from app.ingest.model import SIGNALS, IngestOptions, Signal
from app.ingest.numbers.units import is_unit
from app.ingest.remembering import remembered
from app.ingest.tags.lists import MAY_PART_THOUSANDS, list_rows, list_text
from app.ingest.telling import without_controls
from app.json_texts import given_json

_MAPPING = ("the mapping", "bad_mapping")
"""What it is called, and the code of all that is wrong with it."""

_WORDS: Mapping[str, Signal] = MappingProxyType(
    {
        **dict.fromkeys(("PV", "MEAS", "MEASUREMENT", "PROCESSVALUE", "PROCESSVARIABLE", "PVVALUE"), "PV"),
        **dict.fromkeys(
            ("OP", "MV", "OUT", "CO", "CV", "OUTPUT", "CONTROLLEROUTPUT", "CONTROLOUTPUT", "MANIPULATEDVARIABLE"), "OP"
        ),
        **dict.fromkeys(("SP", "SV", "SETP", "SETPOINT", "SPT", "WSP", "SETPOINTVALUE"), "SP"),
        **dict.fromkeys(("MODE", "MD", "MODEACTUAL", "CTRLMODE", "CONTROLLERMODE", "AUTOMAN"), "MODE"),
        "ISTWERT": "PV",
        **dict.fromkeys(("STELLWERT", "STELLGROESSE"), "OP"),
        "SOLLWERT": "SP",
        "BETRIEBSART": "MODE",
        **dict.fromkeys(("REGELGROESSE", "MESSWERT", "MESURE", "MEDIDA", "测量值"), "PV"),
        **dict.fromkeys(("SORTIE", "SALIDA", "输出", "阀位"), "OP"),
        **dict.fromkeys(("FUEHRUNGSGROESSE", "CONSIGNE", "CONSIGNA", "设定值"), "SP"),
        **dict.fromkeys(("MODO", "РЕЖИМ", "模式"), "MODE"),
    }
)
_RANKS = MappingProxyType({word: rank for rank, word in enumerate(_WORDS)})
_SPELLED_OUT = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "AE", "Ö": "OE", "Ü": "UE", "ß": "ss"})
AUDITED = frozenset({"PV", "OP"})
"""The signals without which a loop cannot be audited."""
OPTIONAL = frozenset({"SP", "MODE"})
SIMULATED = ("pv_sim", "pvsim", "sim", "simulation", "simulated")
"""What a simulated PV is called, in small letters and without its unit, the usual name first."""
_ATTRIBUTES = frozenset(
    {"CV", "VALUE", "ACTUAL", "ACT", "VAL", "F"}
)  # DeltaV writes FIC101/PV.CV and FIC101/MODE.ACTUAL
LONGEST_NAME = 1000  # the patterns cost the square of a name's length
LONGEST_LOOP = IngestOptions().max_name
SEPARATORS = "._-/:|\\ "
_LETTER = r"(?:[^\W\d_]|[\u0300-\u036f])"  # of any script, or its accent where that stands behind it
_ANY_LETTER = re.compile(r"[^\W\d_]")
_ENDING = re.compile(rf"^(?P<loop>.+)[._\-/:|\\ ]+(?P<word>{_LETTER}+)$")
_START = re.compile(rf"^(?P<word>{_LETTER}+)[._\-/:|\\ ]+(?P<loop>.+)$")
_WITHOUT_BLANKS = re.compile(rf"^(?P<loop>.+)(?P<word>{'|'.join(word for word in _WORDS if not word.isascii())})$")
"""Chinese puts no blank before a word."""
_OF_SYSTEMS: Mapping[str, Signal] = MappingProxyType(
    {
        **dict.fromkeys(("PV_OUT", "PV_IN", "VAL_PV"), "PV"),
        **dict.fromkeys(("LMN", "VAL_CVOUT", "MV_OUT"), "OP"),
        **dict.fromkeys(("VAL_SP", "SP_OUT", "SP_IN"), "SP"),
        **dict.fromkeys(("AUTACT", "STS_AUTO", "QMAN_AUT"), "MODE"),
    }
)
"""Names of blocks in PCS 7 (with `#Value` behind them) and PlantPAx that their endings alone would misread."""
_CURRENT_VALUE = re.compile(r"(?i)(?:#Value|[._]F_CV)$")
"""What WinCC and iFIX write behind the names of tags: FIC101/PID.PV_IN#Value, NODE.FIC101_PV.F_CV."""
_UNIT_AND_NETWORK = re.compile(r"(?i)\.UNIT\d+@NET\d+$")
"""Where the points of Ovation stand: FIC101-PV.UNIT1@NET1."""
_OF_FILE = re.compile(r"(?i)(\.UNIT\d+@NET\d+)*")
"""What names a loop only behind what its file is called."""
_OF_SYSTEM = re.compile(rf"(?i)(?P<loop>.+)[._\-/:|\\ ](?P<word>{'|'.join(_OF_SYSTEMS)})")
_SWITCH = re.compile(r"(?P<loop>.*\d[^.]*)\.(?:MA|AM|(?i:AUTO|MANUAL))")
"""Whether a controller is in automatic, as in Foxboro's CP01:FIC101.MA, or in manual. FIC101_mA is a current."""
_SPLIT_WORDS = re.compile(
    r"(?i)[._\- ](set[ _]point|process[ _]value|process[ _]variable|controller[ _]output|control[ _]output)$"
)
_ISA = re.compile(r"^(?P<before>.*?)(?P<measured>[A-Z]{1,2})(?P<function>T|IT|V|CV)(?P<rest>[_\-.]?\d+[A-Z]?)$")
_UNIT = re.compile(
    r"\s*(\((?:[^()]|\([^()]*\))*\)|\[(?:[^\[\]]|\[[^\[\]]*\])*\])$"
)  # FIC101.PV (degC), FIC101.OP [%], PIC101.PV (kg/cm2(g))
_UNIT_UNBRACKETED = re.compile(r"^(?P<name>.*[^, ])[, ]+(?P<unit>[^, ]+)$")  # FIC101.PV t/h
_DESCRIBED = re.compile(r"^(?P<name>[^ ]+[._/][A-Za-z]+) +[-–] +[^ ].*$")  # FIC101.PV - Feed flow
_BRACKET = re.compile(r"[\[(].*$")
_NO_LETTER = re.compile(r"[\W\d_]+")
_SERVER = re.compile(r"(?i)^(?:\\\\[^\\]+|\w*Archive\w*)\\")
"""Where a tag is kept: \\\\PISRV\\FIC101.PV, and SystemArchive\\FIC101/PV_Out#Value of WinCC."""
_QUOTED = re.compile(r'(?i)(?:(?:nsu?=[^;"]+;)?s=)?"[^"]+"(?:\."[^"]+")+')
"""As S7 controllers write names, over OPC UA too: ns=3;s="DB1"."FIC101"."PV"."""
_LIKE_TAG = re.compile(r"\S*\d\S*")
_NUMBERED = re.compile(r"\D*(\d+)\D*")


@dataclass(frozen=True)
class MappedTag:
    """What a plant says about one tag. `attributes`: unit, low, high, loop_type and whatever else its columns hold,
    as text."""

    tag: str
    loop: str
    signal: Signal
    attributes: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    def number(self, name: str) -> float | None:
        try:
            return float(self.attributes[name].replace(",", "."))
        except (KeyError, ValueError):
            return None


@dataclass(frozen=True)
class TagMapping:
    """Tags that a plant has mapped to loops; a tag that is not named here is grouped by its name.

    kept: what was said of tags once for later files too; `entries`, said of this file, go before it. without_units: the
    same by names without units, of those that have one such name alone.
    """

    entries: Mapping[str, MappedTag]
    kept: Mapping[str, MappedTag] = field(default_factory=lambda: MappingProxyType({}))
    without_units: Mapping[str, MappedTag] = field(default_factory=lambda: MappingProxyType({}))

    @classmethod
    def from_bytes(cls, data: bytes) -> "TagMapping":
        """From CSV or JSON with the columns tag, loop, signal[, unit, low, high, loop_type, ...].

        Raises DataError("bad_mapping") where a row has no tag, no loop or no known signal or has a span that is none,
        where a tag has two places, where no row is, or where it is no text.
        """
        text = mapping_text(data)
        rows = _json_rows(text) if text.lstrip()[:1] in ("[", "{") else _csv_rows(text)
        mapped = [_mapped(number, row) for number, row in enumerate(rows, start=1)]
        if not mapped:
            raise DataError("bad_mapping", "the mapping names no tag; it needs rows of tag, loop and signal")
        entries: dict[str, MappedTag] = {}
        for entry in mapped:
            other = entries.setdefault(entry.tag.casefold(), entry)
            if (other.loop, other.signal) != (entry.loop, entry.signal):
                places = f"{other.signal} of {other.loop!r} and {entry.signal} of {entry.loop!r}"
                raise DataError("bad_mapping", f"the mapping has tag {entry.tag!r} in two places: {places}")
            entries[entry.tag.casefold()] = entry
        return cls(MappingProxyType(entries))

    def with_kept(self, kept: Iterable[MappedTag]) -> "TagMapping":
        """A kept place that `entries` give to another tag is not used: that tag's word is the newer one."""
        given = {(entry.loop.casefold(), entry.signal) for entry in self.entries.values() if entry.signal != "OTHER"}
        used = {entry.tag.casefold(): entry for entry in kept if (entry.loop.casefold(), entry.signal) not in given}
        names = Counter(without_unit(name) for name in used)
        plain = {name: entry for told, entry in used.items() if names[name := without_unit(told)] == 1}
        return TagMapping(self.entries, MappingProxyType(used), MappingProxyType(plain))

    def over(self, earlier: "TagMapping") -> "TagMapping":
        """With what an earlier one says of the same file, but of tags named again and of places given to others."""
        given = {(entry.loop.casefold(), entry.signal) for entry in self.entries.values() if entry.signal != "OTHER"}
        kept = {name: it for name, it in earlier.entries.items() if (it.loop.casefold(), it.signal) not in given}
        return TagMapping(MappingProxyType({**kept, **self.entries}))

    def as_bytes(self) -> bytes:
        """As `from_bytes` takes it."""
        rows = [{**it.attributes, "tag": it.tag, "loop": it.loop, "signal": it.signal} for it in self.entries.values()]
        return json.dumps(rows).encode()

    def find(self, tag: str) -> MappedTag | None:
        name = tag.casefold()
        return self.entries.get(name) or self.kept.get(name) or self._in_any_unit(name)

    def _in_any_unit(self, name: str) -> MappedTag | None:
        return self.without_units.get(without_unit(name)) if self.without_units else None

    def is_kept(self, tag: str) -> bool:
        """Whether its place is one that was kept."""
        return tag.casefold() not in self.entries and self.find(tag) is not None

    def rank(self, tag: str) -> int:
        """0 of what is said of this file, 1 of what was kept, 2 of that in another unit, 3 of other tags."""
        name = tag.casefold()
        known = (name in self.entries, name in self.kept, self._in_any_unit(name) is not None)
        return known.index(True) if any(known) else len(known)


def mapping_text(data: bytes) -> str:
    """Decoded as an export is. Raises DataError("bad_mapping") where it is no text."""
    return list_text(data, *_MAPPING)


def _csv_rows(text: str) -> list[dict[str, str]]:
    listed = list_rows(text, *_MAPPING)
    rows = [row for _, row in listed.rows]
    for number, row in enumerate(rows, start=1):
        if doubtful := [name for name in ("low", "high") if listed.in_doubt(row.get(name, ""))]:
            said = " and ".join(f"{name} {row[name]!r}" for name in doubtful)
            raise DataError("bad_mapping", f"row {number} of the mapping has {said}, {MAY_PART_THOUSANDS}")
    return rows


def _json_rows(text: str) -> list[dict[str, str]]:
    try:
        rows = given_json(text)
    except (ValueError, RecursionError) as error:
        raise DataError("bad_mapping", f"the mapping is not JSON: {error}") from error
    rows = rows.get("tags", []) if isinstance(rows, dict) else rows
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise DataError("bad_mapping", "the mapping must be a list of objects with tag, loop and signal")
    return [
        {_json_text(name).lower(): _json_text(cell) for name, cell in row.items() if cell is not None} for row in rows
    ]


def _json_text(cell: object) -> str:
    """Without half of a letter, which JSON can spell and no database takes in a text."""
    return str(cell).encode("utf-8", "replace").decode("utf-8").strip()


def _mapped(number: int, row: Mapping[str, str]) -> MappedTag:
    cells = dict(row)
    tag, loop = cells.pop("tag", ""), without_controls(cells.pop("loop", ""))
    word = cells.pop("signal", "")
    signal: Signal | None = "OTHER" if word.upper() == "OTHER" else _WORDS.get(_plain(word))
    if not tag or not loop or signal is None:
        need = "tag, loop and a signal of PV, OP, SP, MODE or OTHER"
        raise DataError(
            "bad_mapping",
            f"row {number} of the mapping has tag {tag!r}, loop {loop!r}, signal {word!r}; it needs {need}",
        )
    if len(loop) > LONGEST_LOOP:
        raise DataError(
            "bad_mapping",
            f"row {number} of the mapping has a loop of more than {LONGEST_LOOP} characters: {loop[:60]!r}",
        )
    mapped = MappedTag(tag, loop, signal, MappingProxyType(cells))
    _check_span(number, mapped)
    return mapped


def _check_span(row: int, mapped: MappedTag) -> None:
    told = {name: text for name in ("low", "high") if (text := mapped.attributes.get(name))}
    ends = [mapped.number(name) for name in told]
    known = [end for end in ends if end is not None and math.isfinite(end)]
    if len(known) < len(told) or (len(known) == 2 and known[0] >= known[1]):
        said = ", ".join(f"{name} {text!r}" for name, text in told.items())
        raise DataError("bad_mapping", f"row {row} of the mapping has the span {said}; it needs numbers, rising")


def _plain(word: str) -> str:
    return _NO_LETTER.sub("", spelled_out(word)).upper()


def spelled_out(word: str) -> str:
    """Without accents, and with umlauts in two letters: Stellgröße is Stellgroesse, température is temperature."""
    if word.isascii():
        return word
    spelled = unicodedata.normalize("NFC", word).translate(_SPELLED_OUT)
    return "".join(letter for letter in unicodedata.normalize("NFKD", spelled) if not unicodedata.combining(letter))


class Place(NamedTuple):
    """Where a tag belongs."""

    tag: str
    loop: str
    signal: Signal


def place(tag: str, stem: str) -> Place:
    """A tag's loop and signal by its name alone; a bare `PV` belongs to the loop that the file is named after."""
    if len(tag) > LONGEST_NAME or not _ANY_LETTER.search(spelled_out(tag)):
        return Place(tag, tag, "OTHER")
    found = _place(tag, "")
    of_file = stem and _OF_FILE.fullmatch(found.loop)
    return _place(tag, stem) if of_file else found  # names of a loop are remembered once for all files


@remembered(1 << 16)
def _place(tag: str, stem: str) -> Place:
    name = without_server(tag)
    name = _name_and_unit(name)[0] or name
    signal = _bare(_BRACKET.sub("", name))
    if signal is not None:
        return Place(tag, stem, signal)
    described = _DESCRIBED.match(name)
    if described and (found := _by_ending(tag, described["name"])):
        return found
    name = _CURRENT_VALUE.sub("", name)
    if where := _UNIT_AND_NETWORK.search(name):
        point = _place(name[: where.start()], stem)
        return Place(tag, tag, "OTHER") if point.signal == "OTHER" else Place(tag, point.loop + where[0], point.signal)
    if of_system := _OF_SYSTEM.fullmatch(name):
        return Place(tag, of_system["loop"].rstrip(SEPARATORS), _OF_SYSTEMS[of_system["word"].upper()])
    if (switch := _SWITCH.fullmatch(name)) and _by_ending(tag, switch["loop"]) is None:
        return Place(tag, switch["loop"], "MODE")
    spelled = _SPLIT_WORDS.search(name)
    if spelled:
        return Place(tag, name[: spelled.start()].rstrip(SEPARATORS), _WORDS[_plain(spelled.group(1))])
    return _by_ending(tag, name) or _by_letters(tag, name) or _by_start(tag, name) or Place(tag, tag, "OTHER")


def without_server(tag: str) -> str:
    """A tag's name without the server that keeps it and the quotes of S7. The namespace of OPC UA stays: two of them
    may have loops of one name."""
    name = _SERVER.sub("", tag.strip())
    return name.replace('"', "") if _QUOTED.fullmatch(name) else name


def loop_of(tag: str, stem: str) -> str:
    """The loop of a tag by its name alone, in a file of this stem."""
    return place(tag, stem).loop


def names_its_loop(tag: str) -> bool:
    """Whether a tag means the same in every file, and is no bare `PV` that belongs to the loop of its file."""
    return place(tag, "").loop != ""


def unit_of(tag: str) -> str:
    """The unit that a name tells behind it, as `degC` of `TIC5.PV (degC)`; empty where it tells none. A number there
    tells columns of one name apart."""
    told = _name_and_unit(tag.strip())[1]
    return "" if told.isdigit() else told


def without_unit(tag: str) -> str:
    """The name before the unit that it tells; all of it where it tells none."""
    if len(tag) > LONGEST_NAME or not unit_of(tag):
        return tag
    return _name_and_unit(tag.strip())[0] or tag


def _name_and_unit(name: str) -> tuple[str, str]:
    """A name and what stands in brackets behind it, or a unit that is known. One of letters alone is a unit behind the
    name of a signal only: `Reactor pH` is a name."""
    if bracketed := _UNIT.search(name):
        return name[: bracketed.start()], bracketed[1][1:-1].strip()
    found = _UNIT_UNBRACKETED.match(name)
    if not found or not is_unit(found["unit"]):
        return name, ""
    word = re.split(r"[._\-/:|\\ ]", found["name"])[-1]
    if found["unit"].isalpha() and _plain(word) not in _WORDS:
        return name, ""
    return found["name"], found["unit"]


def _bare(name: str) -> Signal | None:
    """The signal that a name without a loop tells. A loop may be called by a number, or in other letters: 4711.PV."""
    signal = _WORDS.get(_plain(name))
    if signal is None:
        return None
    found = _ENDING.match(name)
    loop = found["loop"] if found else ""
    return None if _plain(loop) == "" and any(map(str.isdigit, loop)) else signal


def _by_ending(tag: str, name: str) -> Place | None:
    found = _ENDING.match(name)
    if found and found["word"].upper() in _ATTRIBUTES:
        inner = _ENDING.match(found["loop"])
        if inner and _plain(inner["word"]) in _WORDS:
            found = inner
    if not found or _plain(found["word"]) not in _WORDS:
        found = _WITHOUT_BLANKS.match(name)
    return Place(tag, found["loop"].rstrip(SEPARATORS), _WORDS[_plain(found["word"])]) if found else None


def _by_letters(tag: str, name: str) -> Place | None:
    """FT_211 is the transmitter and FV_211 the valve of loop F_211."""
    found = _ISA.match(name)
    if not found or found["before"][-1:].isalnum():
        return None
    loop = f"{found['before']}{found['measured']}{found['rest']}"
    return Place(tag, loop, "PV" if found["function"].endswith("T") else "OP")


def _by_start(tag: str, name: str) -> Place | None:
    """`PV_sim` is simulated, and no PV of a loop `sim`."""
    found = _START.match(name)
    signal = _WORDS.get(_plain(found["word"])) if found else None
    if not found or not signal or found["loop"].lower() in SIMULATED:
        return None
    return Place(tag, found["loop"], signal)


def like_a_tag(name: str) -> bool:
    """Without a blank, with a digit: a row of descriptions may stand beside the one of tags."""
    return _LIKE_TAG.fullmatch(name) is not None


def share_like_tags(names: Iterable[str]) -> float:
    """How many of the names, of columns that have one, are like tags, 0 to 1."""
    given = [name for name in names if name]
    return sum(map(like_a_tag, given)) / max(1, len(given))


def number_of(tag: str) -> str:
    """The number of a name without a loop: `2` of Mode2, nothing of Mode and of FIC101.MODE."""
    if names_its_loop(tag):
        return ""
    found = _NUMBERED.fullmatch(_BRACKET.sub("", without_server(tag)))
    return found[1] if found else ""


def precedence(tag: str) -> tuple[int, int]:
    """Signals by their own names first (OP before MV), other plain names in the order of `_WORDS`, then PV and OP by
    their number, then what has to have the number of these."""
    if number_of(tag):
        return (3 if place(tag, "").signal in OPTIONAL else 2), 0
    word = _NO_LETTER.split(spelled_out(_name_and_unit(tag.strip())[0]).upper())[-1]
    return (0 if word in SIGNALS else 1), _RANKS.get(word, len(_RANKS))
