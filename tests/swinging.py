"""A wide export of loops that swing, so that each can be audited."""

import csv
import io

from app.services.outward import GroupMemberOut, GroupOut

UNREADABLE_ROWS = (7, 9)


def wide(*tags: str, samples: int = 400, unreadable: str | None = None) -> bytes:
    """PV, OP and SP of each loop, in 5 s. unreadable: what stands for PV in two of the rows, if anything."""
    text = io.StringIO()
    rows = csv.writer(text)
    rows.writerow(["DateTime", *(f"{tag}.{signal}" for tag in tags for signal in ("PV", "OP", "SP"))])
    for k in range(samples):
        minutes, seconds = divmod(k * 5, 60)
        swing = (k % 40) / 20 - 1
        pv = unreadable if unreadable and k in UNREADABLE_ROWS else 50 + swing**2 + k % 3 * 0.1
        stamp = f"2026-01-01T{minutes // 60:02d}:{minutes % 60:02d}:{seconds:02d}Z"
        rows.writerow([stamp, *(value for _ in tags for value in (pv, 40 + 5 * swing, 50))])
    return text.getvalue().encode()


def group_of(
    number: str,
    period_s: float,
    in_step: bool,
    by_chance: bool,
    chance_probability: float,
    source: str | None,
    members: list[GroupMemberOut],
    set_points_together: bool = False,
) -> GroupOut:
    """A group by its fields in a row."""
    return GroupOut(
        id=number,
        period_s=period_s,
        in_step=in_step,
        by_chance=by_chance,
        chance_probability=chance_probability,
        source=source,
        members=members,
        set_points_together=set_points_together,
    )
