"""The settings of this process; what is wrong with them in words."""

from typing import TYPE_CHECKING

from app.errors import RequestError

if TYPE_CHECKING:
    from app.settings import Settings


def load_settings() -> "Settings":
    """Raises RequestError("settings") that names each variable that cannot be used."""
    from pydantic import ValidationError

    from app.settings import Settings

    try:
        return Settings()
    except ValidationError as error:
        wrong = (
            f"LOOPAUDIT_{'_'.join(map(str, item['loc'])).upper()}: {item['msg'].removeprefix('Value error, ')}"
            for item in error.errors()
        )
        raise RequestError("settings", "; ".join(wrong)) from None
