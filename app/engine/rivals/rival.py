"""One rival explanation."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Rival:
    """An explanation other than stiction.

    cause: a stable code. strength: 0 (nothing speaks for it) to 1; from 0.5 on it stands out.
    counts: log-odds that it takes from stiction where it stands out; 0 where the shapes already say so.
    text: what was seen, in words.
    """

    cause: str
    strength: float
    text: str
    counts: float = 0.0

    @property
    def stands_out(self) -> bool:
        return self.strength >= 0.5
