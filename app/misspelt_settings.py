"""Variables of the environment that look like settings and are none."""

import difflib
import re
from collections.abc import Mapping

from app.settings import PREFIX, Settings

READ_ELSEWHERE = re.compile(r"LOOPAUDIT_(URL|KEY|RECORDINGS|TEST_\w+)")
"""By commands that are clients of a service, by the evaluation and by the tests."""
OF_KUBERNETES = re.compile(r"\w+_(SERVICE_HOST|SERVICE_PORT(_\w+)?|PORT_\d+_(TCP|UDP)(_\w+)?)")
"""What it tells each container of a service whose name begins with loopaudit."""
CLOSE = 0.75


def misspelt(environment: Mapping[str, str]) -> list[str]:
    """A sentence for each variable that looks like a setting and is none: it has no effect, and nobody may notice."""
    known = [name.upper() for name in Settings.model_fields]
    told = []
    for variable, value in sorted(environment.items()):
        name = variable.upper().removeprefix(PREFIX)
        if not variable.upper().startswith(PREFIX) or name in known or _read_elsewhere(variable, value):
            continue
        meant = difflib.get_close_matches(name, known, n=1, cutoff=CLOSE)
        instead = f"did you mean {PREFIX}{meant[0]}?" if meant else "docs/SETTINGS.md lists them"
        told.append(f"{variable} is no setting; {instead}")
    return told


def _read_elsewhere(variable: str, value: str) -> bool:
    linked = OF_KUBERNETES.fullmatch(variable) or (variable.endswith("_PORT") and value.startswith(("tcp:", "udp:")))
    return bool(linked or READ_ELSEWHERE.fullmatch(variable))
