"""The settings of this process; what is wrong with them in words."""

import logging
import os
import sys
from functools import cache
from typing import TYPE_CHECKING, TextIO

from app.cli.messages import say, say_as_log
from app.errors import RequestError, in_our_words

if TYPE_CHECKING:
    from app.settings import Settings


def load_settings(*, warns: bool = True, unattended: bool = False) -> "Settings":
    """Raises RequestError("settings") that names each variable that cannot be used. Once a process it is told which
    ones are no settings, unless `warns` is False: where somebody else tells it. unattended: nobody reads along,
    so that what the command says is a line of JSON too, where the log is asked for in that form.
    """
    from pydantic import ValidationError

    from app.settings import Settings

    if unattended and asks_for_json():
        say_as_log()
    if warns:
        warn_of_misspelt()
    try:
        settings = Settings()
    except ValidationError as error:
        wrong = (f"{named(item['loc'])}{in_our_words(item['msg'])}" for item in error.errors())
        raise RequestError("settings", "; ".join(wrong)) from None
    logging.lastResort = LogOfCommand(settings)
    if unattended and settings.log_format == "json":
        from app import logs

        logs.configure(settings, least="WARNING")  # until it is at work, if it is one of those with a log
    return settings


def asks_for_json() -> bool:
    """Before the settings are read: what is wrong with them is said in this form too."""
    return any(name.upper() == "LOOPAUDIT_LOG_FORMAT" and value == "json" for name, value in os.environ.items())


class LogOfCommand(logging.StreamHandler[TextIO]):
    """What is logged in a command that has no log, warnings and worse: in the form of the settings, without secrets.
    A message that cannot be written, or is of other values than it was made for, does not end the command."""

    def __init__(self, settings: "Settings") -> None:
        super().__init__()
        self.setLevel(logging.WARNING)
        self._settings = settings

    def emit(self, record: logging.LogRecord) -> None:
        self.stream = sys.stderr  # as it is now
        super().emit(record)

    def format(self, record: logging.LogRecord) -> str:
        from app.logs import formatter, is_json

        return formatter(is_json(self._settings)).format(record)


def named(place: tuple[int | str, ...]) -> str:
    """The variable, with a colon; nothing for what several of them say together, which names them itself."""
    return f"LOOPAUDIT_{'_'.join(map(str, place)).upper()}: " if place else ""


@cache
def warn_of_misspelt() -> None:
    from app.misspelt_settings import misspelt

    for sentence in misspelt(os.environ):
        say(f"loopaudit: warning: {sentence}", "warning")
