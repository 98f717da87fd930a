"""The settings of this process; what is wrong with them in words."""

import os
from functools import cache
from typing import TYPE_CHECKING

from app.cli.messages import say
from app.errors import RequestError

if TYPE_CHECKING:
    from app.settings import Settings


def load_settings(*, warns: bool = True) -> "Settings":
    """Raises RequestError("settings") that names each variable that cannot be used. Once a process it is told which
    ones are no settings, unless `warns` is False: where somebody else tells it.
    """
    from pydantic import ValidationError

    from app.settings import Settings

    if warns:
        warn_of_misspelt()
    try:
        return Settings()
    except ValidationError as error:
        wrong = (f"{named(item['loc'])}{item['msg'].removeprefix('Value error, ')}" for item in error.errors())
        raise RequestError("settings", "; ".join(wrong)) from None


def named(place: tuple[int | str, ...]) -> str:
    """The variable, with a colon; nothing for what several of them say together, which names them itself."""
    return f"LOOPAUDIT_{'_'.join(map(str, place)).upper()}: " if place else ""


@cache
def warn_of_misspelt() -> None:
    from app.settings import misspelt

    for sentence in misspelt(os.environ):
        say(f"loopaudit: warning: {sentence}")
