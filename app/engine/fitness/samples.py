"""The samples of a recording that can be used, as the checks narrow them."""

from dataclasses import dataclass

from app.engine.recording import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Samples:
    """The samples that are still in: (N,) each, PV and OP finite; sp NaN where it is missing, None where it was not
    recorded, as automatic where the mode was not.
    """

    time_s: FloatArray
    pv: FloatArray
    op: FloatArray
    sp: FloatArray | None
    automatic: BoolArray | None

    def __len__(self) -> int:
        return len(self.time_s)

    def part(self, which: slice | BoolArray) -> "Samples":
        sp = None if self.sp is None else self.sp[which]
        automatic = None if self.automatic is None else self.automatic[which]
        return Samples(self.time_s[which], self.pv[which], self.op[which], sp, automatic)
