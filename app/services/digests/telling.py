"""A digest in words: the text and the page of a mail, and what a webhook gets."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from datetime import datetime
from functools import partial
from typing import Any

from app.services.addresses import loop_address
from app.services.digests.digest import Digest, DigestLoop
from app.services.digests.doings import Asked, Doing
from app.services.moments import PlantClock
from app.services.plant.repaired import RepairView
from app.services.plant.worst import nothing_worst
from app.services.rendering import document
from app.services.results import ChangeView
from app.services.telling.naming import one_line
from app.services.telling.wording import (
    CHANGE_WORDS,
    VERDICT_RANK,
    VERDICT_WORDS,
    brief,
    cause_words,
    health,
    starter_words,
    unusual_importance,
)


def subject(digest: Digest) -> str:
    """One line whatever the plant is called: it becomes the head of a mail."""
    words = one_line(digest.plant)
    sticking = digest.verdicts.get("stiction", 0)
    relied = f" ({digest.reliable:,} can be relied on)" if sticking else ""
    new = [change.reliability == "reliable" for change in digest.changes if change.kind == "new"]
    of_them = "" if digest.new_besides or all(new) else f" ({sum(new):,} can be relied on)"
    news = f", {len(digest.new):,} new{of_them}" if digest.new else ""
    day = digest.clock.date_of_run(digest.run.night, datetime.fromisoformat(digest.run.created_at))
    return f"{words}: {sticking:,} {'valve sticks' if sticking == 1 else 'valves stick'}{relied}{news} ({day})"


def as_text(digest: Digest) -> str:
    run = digest.run
    lines = [
        f"Audit of {one_line(digest.plant)}, run {run.id}, {digest.clock.told(run.created_at)}:",
        f"{_counted(digest)}.",
    ]
    for name in VERDICT_RANK:
        lines.append(f"  {digest.verdicts.get(name, 0):6,} {VERDICT_WORDS[name]}")
        if name == "not_auditable":
            lines += [f"         {told}" for told in _refused(digest)]
    lines += [f"  {run.failed:6,} failed"] if run.failed else []
    lines += digest.arrivals
    lines += ["", "WHAT CHANGED SINCE THE RUN BEFORE", ""]
    lines += _change_lines(digest) or [_no_change(digest)]
    lines += [f"  {digest.besides}"] if digest.besides else []
    lines += ["", "WHAT TO DO"] if digest.work else []
    lines += [line for doing in digest.doings for line in _doing_lines(doing, digest)]
    lines += ["", f"{digest.unlisted.words}."] if digest.unlisted.words else []
    if digest.repairs:
        lines += ["", "REPAIRS OF THE LAST FORTNIGHT", ""]
        lines += [_repair_line(repair, digest.clock) for repair in digest.repairs]
        lines += ["  ... and more"] if digest.more_repairs else []
    for area in digest.others:
        title = f"WORST OF {one_line(area.unit) if area.unit else 'THE LOOPS WITHOUT A UNIT'}, OF THE OTHERS"
        lines += _listed(title, _loop_lines, area.loops)
    if not digest.areas:
        lines += ["", _nothing_worst(digest)]
    lines += _listed(f"WORST OF OLD RECORDS: {digest.why_old}", partial(_old_lines, digest), digest.old)
    lines += _shelved_lines(digest)
    lines += ["", f"The whole plant: {digest.public_url}/" if digest.public_url else "", "", HOW_TO_READ]
    return "\n".join(lines) + "\n"


def as_html(digest: Digest) -> str:
    return document(
        "digest.html",
        digest=digest,
        counted=_counted(digest),
        refused=_refused(digest),
        no_change=_no_change(digest),
        nothing_worst=_nothing_worst(digest),
        how_to_read=HOW_TO_READ,
        addresses=_addresses(digest),
    )


def as_json(digest: Digest) -> dict[str, Any]:
    """What a webhook gets, flat where it can be."""
    told = asdict(digest)
    run, shelved = told.pop("run"), told.pop("shelf")["listed"]
    del told["public_url"], told["clock"], told["changed"]
    changed = digest.changed
    told |= {"changes": list(map(asdict, changed.listed)), "more_changes": changed.more}
    told |= {"new_besides": changed.new_besides, "other_changes": changed.others}
    for work in told["work"]:
        work["step"] = work["step"]["text"]
    return (
        {"type": "loopaudit.digest", "subject": subject(digest), "text": as_text(digest)}
        | told
        | {
            "audit_id": run["id"],
            "audited_at": run["created_at"],
            "loops": run["total"],
            "failed": run["failed"],
            "address": digest.public_url,
            "shelved": shelved,
        }
    )


HOW_TO_READ = (
    "Valves newly said to stick come first, then loops by (100 - health) x importance. The lists of the worst have "
    "loops whose valve sticks or may stick, or whose PV does not answer OP; the plant page has all loops. 'Look "
    "first' means that the evidence is not sufficient: look at the loop before a valve is taken out."
)


def _refused(digest: Digest) -> list[str]:
    """Why loops were not auditable, and which: whoever mends a transmitter looks for its tag."""
    told = []
    for cause, count in digest.refused.items():
        named = [one_line(tag) for tag in digest.refused_loops.get(cause, ())]
        more = ", ..." if count > len(named) else ""
        listed = f"{', '.join(named)}{more}" if named else "shelved"
        told.append(f"{count:,} not auditable: {cause_words(cause)} ({listed})")
    return told


def _loop_lines(place: int, loop: DigestLoop) -> list[str]:
    told = f"{VERDICT_WORDS[loop.verdict]} ({loop.told})"
    weight = unusual_importance(loop)
    state = f"health {health(loop.health)}{f', {weight}' if weight else ''}"
    head = f"  {place}. {one_line(loop.loop)}: {told}, {state}"
    of_time = [f"     {loop.judged}"] if loop.judged else []
    shelved = [f"     {loop.shelved}"] if loop.shelved else []
    return [head, *of_time, *shelved, f"     {one_line(loop.why)}", *([f"     {loop.address}"] if loop.address else [])]


def _old_lines(digest: Digest, place: int, loop: DigestLoop) -> list[str]:
    head, *others = _loop_lines(place, loop)
    return [f"{head}, {digest.recorded(loop)}", *others]


def _counted(digest: Digest) -> str:
    """How many loops of the run have a verdict, so that the counts below add up to it."""
    gone = digest.retired
    retired = f"; {gone:,} more {'have' if gone > 1 else 'has'} been retired since" if gone else ""
    total = digest.run.total - gone
    return f"{digest.run.done - gone:,} of {total:,} {'loop has' if total == 1 else 'loops have'} a verdict{retired}"


def _listed(title: str, told: Callable[[int, Any], list[str]], found: Sequence[Any]) -> list[str]:
    """Each under its title, with its place; nothing where there is none."""
    lines = ["", title, ""] if found else []
    for place, one in enumerate(found, 1):
        lines += told(place, one)
    return lines


def _doing_lines(doing: Doing, digest: Digest) -> list[str]:
    """The step once, and under it a line a loop."""
    more = [f"  - {digest.more_of(doing)}"] if doing.more else []
    head = f"{doing.told[:1].upper()}{doing.told[1:]}. {doing.step}"
    return ["", head, *(_asked_line(one, digest.public_url) for one in doing.loops), *more]


def _asked_line(one: Asked, url: str) -> str:
    facts = ("NEW" if one.new else "", one_line(one.facts), loop_address(url, one.loop))
    told = "; ".join(fact for fact in facts if fact)
    unit = f" ({one_line(one.unit)})" if one.unit else ""
    return f"  - {one_line(one.loop)}{unit}{f': {told}' if told else ''}"


def _change_lines(digest: Digest) -> list[str]:
    return [_change_line(change) for change in digest.changes] + [f"  {told}" for told in digest.to_manual]


def _change_line(change: ChangeView) -> str:
    before = VERDICT_WORDS[change.before] if change.before else "not audited"
    words = f"{CHANGE_WORDS[change.kind]} ({before} -> {VERDICT_WORDS[change.now]})"
    sure = "" if change.reliability == "reliable" else f", {brief(change.said)}"
    return f"  {one_line(change.loop)}: {words}{sure}; {change.because}"


def _repair_line(repair: RepairView, clock: PlantClock) -> str:
    told = f"; {repair.verdicts}" if repair.verdicts else ""
    return f"  {one_line(repair.loop)}, repaired {clock.short(repair.repaired_at)}: {repair.words}{told}"


def _no_change(digest: Digest) -> str:
    if not digest.compared:
        return "This is the first run: there is nothing to compare with."
    return "No verdict changed since the run before."


def _nothing_worst(digest: Digest) -> str:
    if not sum(digest.verdicts.values()):
        return "No loop in service has a verdict."
    return nothing_worst(digest.verdicts.get("stiction", 0), bool(digest.old))


def _shelved_lines(digest: Digest) -> list[str]:
    if not digest.shelf.listed:
        return []
    told = [
        f"  {one_line(one.loop)}, {one.words(digest.clock)}; by {one_line(starter_words(one.by))}; now: {one.said}"
        for one in digest.shelf.listed
    ]
    return ["", digest.shelf.count_words.upper(), "", *told]


def _addresses(digest: Digest) -> dict[str, str]:
    named = (
        [one.loop for one in digest.work]
        + digest.new_besides
        + [change.loop for change in digest.changes]
        + [repair.loop for repair in digest.repairs]
        + [one.loop for one in digest.shelf.listed]
    )
    return {tag: loop_address(digest.public_url, tag) for tag in named}
