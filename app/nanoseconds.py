"""Times of samples are whole nanoseconds since 1970: how many of them other units have."""

NS_PER_S = 1_000_000_000
NS_PER_H = 3600 * NS_PER_S
NS_PER_DAY = 24 * NS_PER_H
EVER_NS = (1 << 63) - 1
"""Later than any sample can be."""
