"""The benchmarks behind `loopaudit bench`: each section measures one promise beside its peers, on this machine.

A section is a function of `Bench` that returns plain figures (JSON-safe); `page` turns the figures of all sections into
docs/PERFORMANCE.md. Nothing is asserted: times belong to the machine, ratios are what travels.
"""
