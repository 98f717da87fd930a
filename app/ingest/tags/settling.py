"""What the tags of a loop tell only beside each other, when all of a file are known: a PV by the loop's bare tag, words
of signals without a separator, blocks of one module."""

import re
from collections.abc import Callable, Mapping

from app.ingest.model import Signal
from app.ingest.tags.grouping import AUDITED, Place, without_server, without_unit
from app.ingest.telling import first_of

Taken = Mapping[tuple[str, Signal], str]
Step = Callable[[Mapping[str, Place], Taken], dict[str, Place]]

_BLOCK = re.compile(r"(?i)(?P<loop>.+)[._/](?:DACA|PIDA|AI\d*|PID\d*)")
_JOINED = re.compile(r"(?i)(?P<loop>.*\d[A-Z]?)(?P<word>PV|OP|SP|MV|SV)")
_WORDS: Mapping[str, Signal] = {"PV": "PV", "OP": "OP", "MV": "OP", "SP": "SP", "SV": "SP"}
_SHOWN = 5
_OF_CONTROLLER = re.compile(
    r"(?i)(?P<loop>.+)[._\-/:|\\ ](?:ERR|ERROR|DEV|DEVIATION|DESC|DESCR|DESCRIPTOR|DESCRIPTION)"
)
"""The control error, which PV and SP make, and what a controller is called."""


def bare_name(tag: str) -> str:
    """Without its server and its unit."""
    return without_unit(without_server(tag))


def family(loop: str) -> str:
    """What is the same of all loops that may yet become one."""
    name = bare_name(loop)
    found = _JOINED.fullmatch(name) or _BLOCK.fullmatch(name)
    return (found["loop"] if found else name).casefold()


def of_words_joined(places: Mapping[str, Place], taken: Taken) -> dict[str, Place]:
    """FIC101PV and FIC101OP, where both are."""
    given = {(loop.casefold(), signal) for loop, signal in taken}
    found: dict[str, dict[Signal, Place]] = {}
    matches = ((tag, _JOINED.fullmatch(bare_name(tag))) for tag in _unplaced(places))
    named = [(list(_WORDS).index(match["word"].upper()), tag, match) for tag, match in matches if match]
    for _, tag, match in sorted(named, key=lambda one: one[0]):
        loop, signal = match["loop"], _WORDS[match["word"].upper()]
        if (loop.casefold(), signal) not in given:
            found.setdefault(loop.casefold(), {}).setdefault(signal, Place(tag, loop, signal))
    return {at.tag: at for signals in found.values() if signals.keys() >= AUDITED for at in signals.values()}


def of_bare_tags(places: Mapping[str, Place], taken: Taken) -> dict[str, Place]:
    """FIC101 beside FIC101.OP, where the loop has no PV."""
    loops = {loop.casefold(): loop for loop, signal in taken if signal == "OP" and (loop, "PV") not in taken}
    found: dict[str, Place] = {}
    for tag in _unplaced(places):
        loop = loops.get(bare_name(tag).casefold())
        if loop is not None:
            found.setdefault(loop, Place(tag, loop, "PV"))
    return {at.tag: at for at in found.values()}


def of_blocks(places: Mapping[str, Place], taken: Taken) -> dict[str, Place]:
    """FIC101.DACA.PV and FIC101.PIDA.OP, where the module has no further block and no signal of its own."""
    signals: dict[str, set[Signal]] = {}
    for loop, signal in taken:
        signals.setdefault(loop, set()).add(signal)
    blocks: dict[str, list[tuple[str, str]]] = {}
    for loop in signals:
        if match := _BLOCK.fullmatch(loop):
            blocks.setdefault(match["loop"].casefold(), []).append((match["loop"], loop))
    own = {loop.casefold() for loop in signals}
    module_of = {
        loop: pair[0][0]
        for module, pair in blocks.items()
        if module not in own and _are_halves([signals[loop] for _, loop in pair])
        if all(tag in places for _, loop in pair for signal in signals[loop] for tag in (taken[loop, signal],))
        for _, loop in pair
    }
    return {tag: at._replace(loop=module_of[at.loop]) for tag, at in places.items() if at.loop in module_of}


def _are_halves(signals: list[set[Signal]]) -> bool:
    """Whether one of two has PV and the other OP, and none what the other has."""
    return len(signals) == 2 and signals[0].isdisjoint(signals[1]) and all(len(one & AUDITED) == 1 for one in signals)


def of_controllers(places: Mapping[str, Place], taken: Taken) -> dict[str, Place]:
    """FIC101.ERR and FIC101.DESC beside FIC101.PV or FIC101.OP."""
    loops = {loop.casefold(): loop for loop, signal in taken if signal in AUDITED}
    named = ((tag, _OF_CONTROLLER.fullmatch(bare_name(tag))) for tag in _unplaced(places))
    found = ((tag, loops.get(match["loop"].casefold())) for tag, match in named if match)
    return {tag: Place(tag, loop, "OTHER") for tag, loop in found if loop is not None}


def tells_of_controller(name: str) -> bool:
    """Whether a name is that of a control error or a description of a loop, which moves no PV."""
    return _OF_CONTROLLER.fullmatch(bare_name(name)) is not None


def _unplaced(places: Mapping[str, Place]) -> list[str]:
    """Tags of which their names alone tell nothing."""
    return [tag for tag, at in places.items() if at.signal == "OTHER" and at.loop.casefold() == tag.casefold()]


STEPS: Mapping[str, Step] = {
    "names that end in PV and OP without a separator were read as": of_words_joined,
    "read as the PV of the loop of its name, which has OP and no other": of_bare_tags,
    "blocks of one module, one with PV and one with OP, were read as one loop": of_blocks,
    "control errors and descriptions were kept beside the signals of their loops": of_controllers,
}
"""What is to be said of each, in the order in which they are looked for."""


def told(moves: Mapping[str, Place]) -> str:
    return first_of([f"{tag} ({at.signal} of {at.loop})" for tag, at in moves.items()], _SHOWN)
