"""Groups of loops that swing together, as the API tells them."""

from app.services.outward import GroupMemberOut, GroupOut


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
