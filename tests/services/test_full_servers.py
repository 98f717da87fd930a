"""A server that has no connection left says so in its own language."""

import gettext
from pathlib import Path

import pytest
from sqlalchemy.exc import OperationalError

from app.services.database_errors import no_connection_left

LANGUAGES = ("de", "es", "fr", "it", "ja", "ka", "ko", "ru", "sv", "uk", "zh_CN", "zh_TW")
FOUND = sorted(Path("/usr/share/locale").glob("*/LC_MESSAGES/postgres-*.mo"))
KNOWN = [path for path in FOUND if path.parent.parent.name in LANGUAGES]
REFUSALS = (
    "sorry, too many clients already",
    'too many connections for role "%s"',
    'too many connections for database "%s"',
    "remaining connection slots are reserved for non-replication superuser connections",
)
OTHERS = ('role "%s" does not exist', "the database system is starting up", 'database "%s" does not exist')
GERMAN = "FATAL:  zu viele Verbindungen von Rolle »plant«"


def refused(words: str) -> OperationalError:
    return OperationalError(None, None, Exception(f"connection failed: {words}"))


@pytest.mark.parametrize("words", [f"FATAL:  {REFUSALS[0]}", GERMAN, "FATAL: no more connections allowed"])
def test_a_refusal_is_known_in_other_languages_too(words: str) -> None:
    assert no_connection_left(refused(words))


@pytest.mark.skipif(not KNOWN, reason="no PostgreSQL with its translations on this machine")
@pytest.mark.parametrize("path", KNOWN, ids=lambda path: path.parent.parent.name)
def test_a_language_of_the_server_is_known(path: Path) -> None:
    with path.open("rb") as file:
        translated = gettext.GNUTranslations(file).gettext
    assert [words for words in REFUSALS if not no_connection_left(refused(translated(words)))] == []
    assert [words for words in OTHERS if no_connection_left(refused(translated(words)))] == []
