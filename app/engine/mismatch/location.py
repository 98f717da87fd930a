"""The first answer, in well under a second: where recording and simulation differ, by scans alone."""

from dataclasses import replace

from app.engine.evidence import Reason
from app.engine.mismatch.compare.comparison import Comparison, glimpse, mended, record_of
from app.engine.mismatch.compare.patterns import find_patterns
from app.engine.mismatch.compare.preparing import prepare
from app.engine.mismatch.compare.read_back import without_read_backs
from app.engine.mismatch.compete.competition import Scanned, glance
from app.engine.mismatch.compete.richer_noise import ANSWERING
from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.refitting import CODE, offered_beside
from app.engine.mismatch.fit.windows import active_mask, whole, windows_along
from app.engine.mismatch.judge.conclude import nothing_left, too_few
from app.engine.mismatch.judge.result import NOWHERE, Location
from app.engine.mismatch.loop.block import Block, Part
from app.engine.mismatch.physics import library
from app.engine.mismatch.physics.generic import CODE as UNNAMED
from app.engine.mismatch.report import location_of, pattern_effect


def locate(comparison: Comparison) -> Location:
    """A first answer without a competition: where the two differ, from scans alone, of a long record thinned."""
    comparison = without_read_backs(mended(comparison))
    found = _first_location(comparison)
    return replace(found, evidence=(*comparison.notes, *found.evidence))


def _first_location(comparison: Comparison) -> Location:
    record = record_of(comparison)
    patterns = find_patterns(record)
    if patterns:
        return location_of((pattern_effect(patterns[0], record),))
    seen = glimpse(comparison)
    base, said = prepare(seen).base, seen.notes[len(comparison.notes) :]
    few = too_few(base.record)
    if few or nothing_left(base):
        return replace(NOWHERE, evidence=(*said, *few))
    found = quick_location(base, (*library(base.record), *offered_beside(base)))
    return replace(found, evidence=(*said, *found.evidence))


def _paying_in_a_scan(base: Fit, blocks: tuple[Block, ...]) -> list[Scanned]:
    return [scanned for scanned in glance(base, blocks) if scanned.gain > scanned.block.penalty]


def quick_location(base: Fit, blocks: tuple[Block, ...]) -> Location:
    """The place, windows and condition of the block whose scan gains most, or nowhere where none pays."""
    paying = _paying_in_a_scan(base, blocks)
    answering = tuple(scanned.block for scanned in paying if scanned.block.place in ANSWERING)
    if answering and not base.given.own:
        richer = {scanned.block.name for scanned in _paying_in_a_scan(base.beside_richer_noise, answering)}
        paying = [s for s in paying if s.block.place not in ANSWERING or s.block.name in richer]
    if not paying:
        return Location(None, (), "nowhere", None)
    # A term that names nothing bends with whatever is there: it is said where no name pays.
    told = [scanned for scanned in paying if scanned.block.code != UNNAMED] or paying
    best = max(told, key=lambda scanned: scanned.gain - scanned.block.penalty)
    if best.block.code == CODE:
        text = (
            f"other parameters of the simulation gain {best.gain:.1f} points of log-likelihood in a scan, more than "
            "any effect does"
        )
        return Location(None, (), "nowhere", None, (Reason("parameters_off", text),))
    part = Part(best.block, best.starts[0].values)
    windows = whole(base.record)
    if best.block.active is not None:
        mask = active_mask(replace(base, plant=best.starts[0].plant or base.plant, parts=(*base.parts, part)), part)
        windows = windows_along(base.record, mask)
    reason = Reason("scan", f"a scan gains {best.gain:.1f} points of log-likelihood with {best.block.code}")
    return Location(best.block.place, windows, best.block.condition, None, (reason,))
