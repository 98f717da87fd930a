"""Kinds of the fields of each tag in all chunks of a file, where its marks are in doubt."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray


class KindsSeen:
    """By the number of a tag or of its column; nothing where those of some chunk were not seen."""

    def __init__(self) -> None:
        self._kinds: NDArray[np.uint8] | None = np.zeros(0, dtype=np.uint8)

    def see(self, kinds: NDArray[np.uint8] | None, numbers: int) -> None:
        """Those of a chunk: (numbers,), or (1,) for all of them; None where they were not seen."""
        if kinds is None or self._kinds is None:
            self._kinds = None
            return
        self._kinds = np.append(self._kinds, np.zeros(numbers - len(self._kinds), dtype=np.uint8)) | kinds

    def of(self, numbers: Mapping[str, int]) -> dict[str, int]:
        """Of tags by their numbers."""
        return {} if self._kinds is None else {tag: int(self._kinds[number]) for tag, number in numbers.items()}
