"""What the product does, in its users' words: plain functions, without a web framework.

Every function takes a `Backend` first (settings, database, queue; `app.services.backend`): `Backend.open(settings)`
once a process, `backend.close()` at its end. What a user can mend is raised as an `app.errors.LoopauditError`,
`NotFoundError` where something is not there. Results are frozen dataclasses, those that the API sends as they are in
`app.services.outward`, others that several rooms answer with in `app.services.results`, the rest in the module that
makes them: times are ISO 8601 in UTC, ids are strings, pages have `rows` and `next_cursor`. Rows of
the reliability table are dicts with the fields of `audit_json.models.ReliabilityRow`.

Rooms, the lower ones known to the upper ones only (a contract of the import linter):

upkeep       schema, sweeper, readiness, backup, retention, doctor, metrics
reports      a loop or the plant as one HTML document        digests      the night's findings, by mail and webhook
explaining   recording against simulation: comparisons, what a worker does, the line, the plot, the words
plant        what people look at: overview, work list, the reliability table, loops, trend, charts, groups, notes
auditing     audit runs, chunks (what a worker does), the nightly run, verdicts heard beside those of other loops
intake       uploads: received and synced, then read
audit_json   an audit as its line, its row, and what is stored beside       access       keys, sessions, roles, trail
telling      a verdict in words: what it says, what it rests on, what to do next

Beside them: demo (a simulated plant), and what all share: backend, found_groups, outward, results, addresses, cursors,
moments, spreadsheet, rendering, heartbeat, patience.

The worker and the schedule are run by `run_worker(settings, concurrency)` and `run_beat(settings)` of
`app.queue.running`.
"""
