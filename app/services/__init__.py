"""What the product does, in its users' words: plain functions, without a web framework.

Every function takes a `Backend` first (settings, data base, queue; `app.services.backend`): `Backend.open(settings)` once a
process, `backend.close()` at its end. What a user can mend is raised as an `app.errors.LoopauditError` (`NotFoundError` where
something is not there). Results are frozen dataclasses of `app.services.results`; times in them are ISO 8601 in UTC, ids are
strings. Pages have `rows` and `next_cursor`.

| module | functions |
|---|---|
| uploads | `receive(backend, filename=, content_type=, reading=) -> Receiving` (context manager: `.write(bytes)`, then `.commit() -> Receipt(upload, created)`), `receive_file(backend, path)`, `get_upload(backend, id)`, `list_uploads(backend, limit, cursor)` |
| reading | `read_upload(backend, id)`: what the worker does |
| loops | `list_loops(backend, limit, cursor, unit=, search=)`, `get_loop(backend, tag)`, `patch_loop(backend, tag, changes)`, `loop_health(backend, tag)`, `verdict_history(backend, tag, limit, cursor)`, `verdict_detail(backend, tag, audit_id=None)` |
| trend | `trend(backend, tag, points=, start=, end=)` |
| audits | `start_audit(backend, LoopFilter(...), trigger=)`, `get_audit(backend, id)`, `list_audits(backend, limit, cursor)`, `cancel_audit(backend, id)`, `failures(backend, id)`, `events(backend, id)` |
| chunks | `audit_chunk(backend, id, owner)`: what the worker does |
| reliability | `reliability_page(backend, limit=, cursor=, sort=, filters=RowFilter(...))`, `reliability_rows(backend, sort=, filters=)`, `plant_summary(backend)` |
| nightly | `nightly(backend, date=None)`, `nightly_if_due(backend)` |
| maintenance | `sweep(backend)`, `migrate(settings)`, `readiness(backend)` |
| audit_line | an `Audit` as JSON, the flat row of the table |
| demo, wording, spreadsheet | the demo plant, codes in words, CSV that is safe to open |
"""
