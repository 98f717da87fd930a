"""How large stiction is, in words that an operator understands, or why the record cannot tell."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

# What a record lacks, by the code of the check that it did not pass; the values are its statistic and the limit.
LACKING = {
    "size_regularity": "the oscillation is too irregular (regularity {0:.2g}, at least {1:.2g} is needed)",
    "size_cycles": "the record holds only {0:.2g} cycles, at least {1:.2g} are needed",
    "size_samples_per_cycle": "a cycle has only {0:.2g} samples, at least {1:.2g} are needed",
    "size_evidence": "the shapes show that the valve sticks, but any size fits PV nearly as well",
    "size_as_sampled": "the historian stored too few points and drew lines between them",
    "size_width": "sizes too far apart fit PV equally well",
}
NOT_STUCK = {
    "no_stiction": "Nothing to state: the valve is not said to stick.",
    "not_auditable": "Not stated, because the record could not be audited.",
}
NO_SWING = (
    "Not stated: PV and OP do not oscillate together in this record, so there is nothing to read a size from. A "
    "record in which the loop cycles would show it."
)
NOT_TOLD = (
    "The record does not show how large it is, so no size is stated. Other values of S and J on this page are "
    "assumptions of the method that they belong to."
)


@dataclass(frozen=True)
class SizeWords:
    """headline: the size or that there is none. lines: what it means, or what the record lacks."""

    headline: str
    lines: tuple[str, ...] = ()


def size_in_words(row: Mapping[str, Any], detail: Mapping[str, Any]) -> SizeWords:
    """`row`: a row of the reliability table; `detail`: what was stored beside its verdict."""
    if row["verdict"] in NOT_STUCK:
        return SizeWords(NOT_STUCK[row["verdict"]])
    if row["stiction_S"] is not None:
        return SizeWords(stated(row), (*meaning(row), *_as_fraction(row, detail)))
    size = detail.get("stiction_size")
    if size is None:
        return SizeWords(NO_SWING)
    return SizeWords(NOT_TOLD, tuple(lacking(finding) for finding in size["findings"] if finding["outcome"] != "pass"))


def stated(row: Mapping[str, Any]) -> str:
    size, low, high = equal_digits(row["stiction_S"], row["stiction_S_low"], row["stiction_S_high"])
    share = row["stiction_S_pct_of_span"]
    of = "OP's span" if share is not None else "the range that OP covers"
    share = share if share is not None else row["stiction_S_pct_of_op_range"]
    told = ""
    if share is not None:
        least, most = (share * row[name] / row["stiction_S"] for name in ("stiction_S_low", "stiction_S_high"))
        told = f"; that is {share:.1f} % of {of} ({least:.1f} to {most:.1f} %)"
    return f"S = {size} units of OP, with 95 % certainty between {low} and {high}{told}."


def _as_fraction(row: Mapping[str, Any], detail: Mapping[str, Any]) -> tuple[str, ...]:
    """Where OP may be a fraction of a span that nobody stated: what S is then."""
    ends = detail.get("op_ends")
    if not ends or not 0.0 <= ends[0] < ends[1] <= 1.0 or row["stiction_S_pct_of_span"] is not None:
        return ()
    return (
        f"OP lies between {ends[0]:.2g} and {ends[1]:.2g} in this record. Where that is a fraction of its span, not "
        f"per cent, S is {100.0 * row['stiction_S']:.1f} % of the span; state the span of OP (0 to 1) in the settings.",
    )


def equal_digits(size: float, *others: float) -> tuple[str, ...]:
    """`size` to three digits, the others with as many behind the point: 9.40, 5.81 and 13.00."""
    digits = max(0, 2 - math.floor(math.log10(size))) if size > 0.0 else 2
    return tuple(f"{value:.{digits}f}" for value in (size, *others))


def meaning(row: Mapping[str, Any]) -> tuple[str, ...]:
    size, low, high = equal_digits(row["stiction_S"], row["stiction_S_low"], row["stiction_S_high"])
    return (
        f"After OP reverses it must travel about {size} units before the stem moves; until then PV does not answer.",
        "J, how far the stem jumps when it lets go, is not stated: it cannot be determined from PV and OP.",
        f"To see it in the field: with the controller in manual, move OP by less than {low} units against the last "
        f"move, and PV should stand; by more than {high}, and it should follow.",
    )


def lacking(finding: Mapping[str, Any]) -> str:
    words = LACKING.get(finding["code"], finding["text"])
    return words.format(finding["statistic"], finding["threshold"])
