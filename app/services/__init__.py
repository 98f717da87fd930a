"""What the product does, in its users' words: plain functions, without a web framework.

Every function takes a `Backend` first (settings, data base, queue; `app.services.backend`): `Backend.open(settings)`
once a process, `backend.close()` at its end. What a user can mend is raised as an `app.errors.LoopauditError`,
`NotFoundError` where something is not there. Results are frozen dataclasses of `app.services.results`: times are ISO
8601 in UTC, ids are strings, pages have `rows` and `next_cursor`. Rows of the reliability table are dicts with the
fields of `audit_line.ReliabilityRow`.

uploads      receive(backend, filename=...) -> Receiving: `.write(bytes)`, then `.commit() -> Receipt(upload, created)`;
             receive_file, get_upload, list_uploads
reading      read_upload: what a worker does with an upload
loops        list_loops, get_loop, patch_loop, loop_health, verdict_history, verdict_detail
trend        trend(backend, tag, points, start, end)
audits       start_audit(backend, LoopFilter(tags, unit, type)), get_audit, list_audits, cancel_audit, failures, events
chunks       audit_chunk: what a worker does for a run
reliability  reliability_page(backend, limit, cursor, sort, RowFilter(...)), sortable, plant_summary
nightly      nightly(backend, day), nightly_if_due
operations   migrate(settings) -> revision, sweep, readiness, metrics
audit_line   an Audit as JSON, the flat row of the table
demo, wording, spreadsheet: the demo plant, codes in words, CSV that is safe to open

The worker and the schedule are run by `app.queue.run_worker(settings, concurrency)` and `app.queue.run_beat(settings)`.
"""
