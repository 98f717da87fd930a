"""loopaudit: audits every control loop of a plant and says which verdicts can be trusted."""

from app import kernel_cache

# Before anything imports numba, which reads its settings once.
kernel_cache.choose()
