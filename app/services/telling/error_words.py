"""What the codes of errors, of refused rows and of failed loops mean, and what to do: each error says what was got."""

_HTTP = {
    "bad_request": "The body is not a form that can be parsed; send it as multipart, with its content type.",
    "body_too_large": "The body is larger than this route takes, or than the disk of the service; send it in parts.",
    "busy": (
        "The service is already answering as many such requests as it may at once; retry after the seconds in "
        "Retry-After."
    ),
    "client_gone": "The connection was closed before the whole body had arrived; send it again.",
    "cross_site": "A page of another site sent this; open the service by its own address and send it from there.",
    "csrf_token": "The form carries no valid token of this login; reload its page and send it again.",
    "data_folder_away": "The data folder is gone or read-only, and nothing was kept; send it again when it is back.",
    "database_away": (
        "The database does not answer; try again, and if that persists, check that it is running and reachable."
    ),
    "disk_full": "The disk of the service is full and nothing was kept; send it again when there is room.",
    "host_not_allowed": "The service does not know the host name it was called by; add it to LOOPAUDIT_ALLOWED_HOSTS.",
    "internal_error": "A fault of the service, not of yours; its log has it under `request_id`.",
    "invalid_key": "The key is not known, has expired or was revoked; use another, or ask for one.",
    "invalid_request": "A parameter or field is missing, unknown or out of range; `errors` says which and why.",
    "key_needed": "This needs a key; send it as `Authorization: Bearer la_...` or `X-API-Key`, or log in.",
    "login": "A page needs a login: the browser is redirected to it (303), and no problem is shown; log in.",
    "media_type": (
        "The body is of a kind that is not accepted here; send the one asked for, and name it in Content-Type."
    ),
    "method_not_allowed": "This address does not take that method; `Allow` names those that it takes.",
    "no_such_route": "There is no such address; it may be mistyped, or of another version of the service.",
    "outcome_unknown": (
        "Database or service went away while it was written; check whether it is there, and if not, send it again."
    ),
    "role": "The key has a role that may not do this; use a key with the role that is named.",
    "route_not_listed": "The route has no entry in the table of permissions, a fault of the service; report it.",
    "too_many_requests": (
        "The key sends more requests than it may, or too many wrong keys came from the address; retry after the "
        "seconds in Retry-After."
    ),
    "too_slow": "The body took too long to arrive; send it again over a faster line, or in smaller parts.",
    "unavailable": "The service cannot answer now; try again in a short while.",
}
_ASKED = {
    "bad_columns": "A column that was asked for is not in the table; the detail lists those that are.",
    "bad_cursor": "The cursor is not one of this list in this order; pass on `next_cursor`, or start without one.",
    "bad_limit": "The page asked for is too small or too large; ask for 1 to 20,000 rows.",
    "bad_points": "A trend has 2 to 10,000 points; ask for a number in that range.",
    "bad_sort": "The table cannot be sorted by this; the detail lists the columns that sort it.",
    "bad_window": "The window needs a start or a length, not both, at most ten years, and an end after its start.",
    "not_audited": "Loop or plant has no verdict yet, or the loop none of this run; wait for an audit or start one.",
    "not_explained": "The explanation has no answer yet, or failed; wait for it, or look at its `error_code`.",
    "unknown_audit": "There is no such run; it may have been removed since; `GET /v1/audits` lists those kept.",
    "unknown_explanation": "The loop has no such explanation; it may have been removed since; ask for a new one.",
    "unknown_loop": (
        "There is no loop with this tag; look it up in `GET /v1/loops`, and percent-encode it in an address."
    ),
    "unknown_upload": "There is no such upload; it may have been removed since; `GET /v1/uploads` lists those kept.",
    "window_too_large": "The window has more samples than can be explained at once; use a shorter one.",
}
_STATED = {
    "bad_continues": (
        "The loop to be continued is not there, is the loop itself or continues it, or goes on as another one already; "
        "a loop that goes on as another cannot be put in service again before that one continues none."
    ),
    "bad_loop_list": "The list of loops cannot be read; it needs a tag and what to set, and at most 20,000 loops.",
    "bad_repair_time": "The repair is in the future; enter it once it is done.",
    "bad_shelving_time": "A loop is shelved until a time in the future, at most a year ahead; give such a time.",
    "bad_span": "The ends of a span must be finite, the low one below the high one; correct them.",
    "bad_value": "The value is not what its field takes, too long, out of its range, or has an ambiguous separator.",
    "changed_meanwhile": "The loop has changed since the request's If-Match; get it again, then change it.",
    "empty_note": "The note is empty; it needs a text, a work order or the time of a repair.",
    "named_twice": "The list names a loop twice; only the first time counts, so leave the other out.",
    "no_reason_to_shelve": "Shelving a loop needs a reason; give a text or a work order.",
    "no_such_repair": "No such note of the loop states a repair; look up the note's id among the loop's notes.",
    "no_such_shelving": "No such note of the loop shelves it; look up the note's id among the loop's notes.",
    "note_too_long": "The text or the work order is longer than allowed; shorten it.",
    "nothing_kept": "No tag mapping of this loop is kept for later files; it may already have been removed.",
    "repaired_and_shelved": "A repair ends a shelving; write two notes, the repair first.",
    "unknown_field": "A loop has no such field; the detail lists those that can be set.",
    "unknown_type": "No such type of loop is known; the detail lists those that are.",
}
_STARTED = {
    "no_loops": (
        "No loop with samples is in the plant, or matches what was asked for; send exports, or ask for other loops. "
        "Of a file that was uploaded: no loop was found in it, and `loopaudit inspect` says which columns it has."
    ),
    "too_many_open": "Too many loops or explanations are waiting already; wait for them, or cancel runs.",
    "unknown_loops": "Some of the given tags are not loops; the detail shows the first five.",
    "wrong_state": (
        "The run has ended, so there is nothing left to cancel; or the key is no longer active or has been rotated "
        "already, so it cannot be rotated: rotate its successor, or create a new one."
    ),
}
_SENT = {
    "bytes_gone": "The file of the upload is no longer kept; send it again, with its mapping.",
    "content_encoding": "The Content-Encoding is not understood; send the body uncompressed, or with gzip.",
    "damaged_samples": "Stored samples of this stretch cannot be read; ask for another, or send their exports again.",
    "empty_upload": "The upload has no bytes; look at the file, and send it again.",
    "mapping_too_large": (
        "The mapping is larger than 16 MiB, more than any plant's; send the export in parts, each with its own."
    ),
    "no_file": "The form has no part named `file` with a file in it; name the part so.",
    "several_files": "The form has several parts with one name, and an upload takes one; send each file by itself.",
    "several_simulations": "More than one simulation is given, and one can be compared; give one.",
    "simulation_too_large": "The simulation has more than 200,000 samples; send fewer, or a shorter stretch.",
    "unknown_time_zone": "This is not a time zone; give an IANA name such as Europe/Berlin.",
    "upload_too_large": "The file is larger than the service accepts (LOOPAUDIT_MAX_UPLOAD_BYTES); send it in parts.",
}
REFUSED_WORDS = {**_HTTP, **_ASKED, **_STATED, **_STARTED, **_SENT}

FILE_WORDS = {
    "bad_mapping": (
        "The mapping cannot be read, or a row lacks tag, loop or signal or has an invalid value; correct it."
    ),
    "compression_ratio": "The file unpacks to far more than exports do, like a decompression bomb; send it unpacked.",
    "decompressed_too_large": "Unpacked, the file is larger than the limit; send it in parts, a workbook as CSV.",
    "empty_file": "The file is empty; export it again, with a column of times and signals.",
    "excel_not_installed": "Reading workbooks needs an extra; install loopaudit[excel], or send CSV.",
    "larger_than_disk": "Reading the file takes more room than the whole disk of the data folder; send it in parts.",
    "line_too_long": "A line is far too long for a row of samples; export it with one row per line.",
    "matlab_version": "MATLAB files of version 7.3 (HDF5) are not read; save it with `save(..., '-v7')`.",
    "more_fields_than_names": (
        "Most rows have more fields than there are names, mostly because decimal commas stand between fields "
        "separated by commas; export it with decimal points, or with semicolons or tabs between the fields."
    ),
    "not_a_table": "The file or text cannot be read as a table with a header; export it as CSV with a row of names.",
    "not_an_export": "The file is damaged, binary, an archive, JSON or XML; send text, gzip, parquet, xlsx or mat.",
    "nothing_readable": "No row has a time and values that can be read, or all names are too long; look at the file.",
    "reader_lost": (
        "The worker that read the file was lost again and again, perhaps for lack of memory; send it again, or in "
        "parts."
    ),
    "too_many_tags": (
        "The file has more tags, or a MATLAB file more loops, than are read from one file; send it in parts."
    ),
    "unknown_layout": (
        "No times with PV and OP or tags beside them were found, or rows of the same time that only a column "
        "distinguishes would be mixed; export it with a row of names, time and tags such as FIC101.PV, or with a "
        "column Loop."
    ),
}

REJECT_WORDS = {
    "bad_quality": "The historian marks the value as not good; it is not used.",
    "bad_time": (
        "The time of the row cannot be read, and the row is not used; look at its text. Of a request: the time is not "
        "like 2026-01-31T12:00, or beyond the years that there are."
    ),
    "duplicate_time": "The tag has two different values at one time; the later one is used.",
    "name_too_long": "The name of the column or tag is longer than allowed; what it holds is not read; shorten it.",
    "no_tag": "The row has no tag, or the row or object of a list of loops names no loop; it is not used, name one.",
    "not_a_number": "There is text in place of a number; the value counts as missing.",
    "not_finite": (
        "The value is infinite or NaN, and counts as missing. Of an identification: PV or OP has missing values in the "
        "stretch, fill them first."
    ),
    "off_line": "The control system's flag says that the signal is off line; the value is not used.",
    "other_names": "The row is below a header that differs from the first one; send that part as a file of its own.",
    "other_unit": "The value is in a different unit from most of its tag; export the tag in one unit.",
    "ragged_row": (
        "The row has fewer fields than names, or extra ones, so that none is certain; correct its separators. For a "
        "list of loops: the row has cells beyond the names."
    ),
    "sentinel": "The number is a code for no data, such as -9999 far from all others; it counts as missing.",
    "sheet_not_read": "A sheet of the workbook cannot be read, the others are; repair it, or send it as CSV.",
    "unbalanced_quote": "The line has an unclosed quote, so that its fields cannot be separated; correct it.",
    "unclear_mark": (
        "The separator in the number may be for decimals or for thousands; export it without thousands separators."
    ),
    "unknown_mode": "The controller mode is not recognised, so it is not known whether the loop was in automatic.",
}

_COMPARED = {
    "interval_differs": (
        "The model's interval is not a whole multiple of the recording's; give one that is sampled as the model's "
        "record was, or a whole number of times faster."
    ),
    "interval_invalid": "The sampling interval is not more than 0; look at the times of the recording.",
    "no_overlap": "Simulation and recording cover different times; give the simulation of the recorded stretch.",
    "no_pv_op": "The file has no column for PV or OP; name them with `--pv` and `--op`.",
    "no_such_column": "There is no file, column or signal of that name; the message lists those that exist.",
    "no_such_loop": "The export has no loop of that name with PV and OP; look at it with `loopaudit inspect`.",
    "not_numeric": "The column that was taken for PV or OP has no numbers; name another.",
    "nothing_known": (
        "No sample of PV is known, or none where it moves, or none of the second recording beyond its start; give a "
        "stretch in which PV was recorded."
    ),
    "same_column": "One column is taken for two signals; name another for one of them.",
    "several_loops": "The export has several loops; name one with `--loop`.",
    "signal_constant": "PV or OP moves too little, or is not finite, to be compared; take a stretch in which it moves.",
    "signal_length": (
        "The signals, or the recording and what a model kept of its own, do not have the same number of samples; give "
        "those that belong together."
    ),
    "signal_missing": "The model has a cause that is not among the recorded signals; record it, or give its column.",
    "signal_not_finite": "The set point or a further signal has samples without a value; fill them, or leave it out.",
    "signal_too_large": (
        "A signal has a value far beyond any plausible size; look for a code for no data, or for another unit."
    ),
    "too_short": "Fewer than 100 samples have time, PV and OP; take a longer stretch.",
}
_SIMULATED = {
    "bad_times": "The times of the simulation are not understood; give ISO 8601, or seconds.",
    "controller_improper": "The controller has more zeros than poles and cannot be simulated; give a proper one.",
    "dead_time_negative": "A dead time of a plant cannot be negative; give 0 s or more.",
    "integral_time": (
        "The integral time of a controller must be above 0 s; give infinity for proportional-only control."
    ),
    "model_invalid": (
        "The model cannot be read, or not be simulated along the recording: it lacks something, has a number that is "
        "not finite, or a value that no process has; correct it, and give `--model` with the `--recording` that "
        "drives it."
    ),
    "no_simulation": "The CSV has times and nothing beside them; add a column PV_sim.",
    "op_not_a_signal": "The OP that a valve is to follow must be one row of finite samples; fill its gaps first.",
    "plant_improper": "The numerator of the plant is not of lower degree than its denominator; give one that is.",
    "simulation_constant": "The simulation does not move, so there is no model behind it; look at how it was made.",
    "simulation_is_pv": "The simulation is PV itself, sample for sample; name the simulated one.",
    "simulation_length": (
        "The simulation has another number of samples or of times than it needs, or does not cover the recording; give "
        "it with its times, or cut both alike."
    ),
    "simulation_not_finite": "The simulation has no values, or gaps within the recording; fill them.",
    "simulation_step": "The sampling interval is not a multiple of the simulation's step; make it one.",
    "simulation_too_short": "The simulation would have fewer than two samples; make it longer.",
    "simulation_unstable": "PV or OP of the simulated loop grew without bound; limit OP, or loosen the tuning.",
    "stiction_band": "A band d, S or J of a simulated valve is negative, or they differ in number; give 0 or more.",
}
COMPARED_WORDS = {**_COMPARED, **_SIMULATED}

LOOP_WORDS = {
    "cancelled": "The loop was cancelled with its run before its audit; start another run if it is wanted.",
    "fault": (
        "A fault of the program in this loop, explanation or file, not in the plant; the log has the details; please "
        "report it."
    ),
    "flat_signal": "PV or OP never moves, so that nothing can be identified; take a stretch in which the loop moves.",
    "memory": "The audit or explanation needed more memory than there is; give workers more, or take a shorter window.",
    "no_samples": "The loop has no samples in the window, or none at all; send its exports, or choose another window.",
    "not_auditable": "No verdict can be given on the recording; the text says why, from the checks of its data.",
    "record_too_short": "The record is too short for what was to be identified from it; take a longer one.",
    "search_space": "An order of an identification is out of 1 to 50, or nc begins with neither 0 nor 1; correct it.",
    "signal_type": "A signal is no row of numbers, or the mode is not true or false at each sample; convert it.",
    "time_limit": "The audit or explanation took longer than it may; take a shorter window, or raise its limit.",
    "time_order": "The times of the recording do not increase; sort its samples, and drop times that repeat.",
    "unknown_setting": (
        "A planned run has a setting that this version does not know; it continues with this version's own."
    ),
    "worker_lost": (
        "The worker was lost again and again at this loop or explanation, often for lack of memory; look at the "
        "machine's log."
    ),
}

_SERVICE = {
    "already_serving": (
        "`serve` is already running with this data folder; use that one, stop it, or name another folder."
    ),
    "being_restored": "A backup is being restored; start again when that is done.",
    "broker_login": "Only in a log: the broker refuses user, password, rights or virtual host; correct the address.",
    "broker_read_only": "Only in a log: the broker's Redis is a replica that takes no writes; name the other one.",
    "broker_refused": "Only in a log: the broker answers and refuses, mostly a Redis that is full; make room in it.",
    "cannot_listen": "The service cannot listen on the host or port; choose another, or stop what uses it.",
    "database_url": "LOOPAUDIT_DATABASE_URL is not an address of PostgreSQL or SQLite; correct it.",
    "file_unseen": (
        "Only in a log: the worker does not see an upload's file; give all of them the same LOOPAUDIT_DATA_DIR, or "
        "mount it."
    ),
    "newer_tables": "A newer loopaudit made these tables; run that one, or restore the backup from before it.",
    "no_database": "There is no database in the data folder; check that LOOPAUDIT_DATA_DIR is that of the service.",
    "no_tables": "The database has no tables; run `loopaudit migrate`.",
    "not_mounted": "There is no database, and its folder is in a place of /etc/fstab that is not mounted; mount it.",
    "not_ready": "The service is not ready, or did not come up in time; the text says what it lacks.",
    "older_tables": "The tables are those of an older version; run `loopaudit migrate`.",
    "settings": "A setting has a value that it cannot have; the text says which, SETTINGS.md what it takes.",
    "standstill": (
        "Loops are waiting, and no worker has given a sign of life for long; check that workers run, and restart them."
    ),
    "still_running": "`serve`, `worker`, `beat` or `nightly` is running on what a restore replaces; stop it first.",
    "tables_in_use": (
        "Other processes use the tables that `migrate` changes; stop `serve`, `worker` and `beat`, then try again."
    ),
}
_BACKUP = {
    "backup_broken": (
        "A file of the backup is missing, changed, damaged or does not belong to it; remove what does not belong to "
        "it, or use another backup."
    ),
    "backup_failed": "A program of PostgreSQL failed; the text is what it said.",
    "backup_kind": "The backup is of PostgreSQL, which SQLite cannot take; set LOOPAUDIT_DATABASE_URL.",
    "backup_newer": "The backup is of a newer version; restore it with the loopaudit that made it.",
    "backup_there": "The folder for the backup already exists; name a new one.",
    "no_backup": "The folder holds no backup of loopaudit; name the one that `loopaudit backup` wrote.",
    "no_exports_folder": "The folder of the exports cannot be read; correct its path or permissions.",
    "no_program": "A client program of PostgreSQL is not installed; install those of its version.",
    "not_empty": "The database to restore into is not empty; `--force` replaces what is in it.",
}
_FILES = {
    "columns": "A labelled recording (`app.lab.evaluation`) must hold one loop with PV and OP; split or correct it.",
    "damaged": "A part of the file could not be read, and the rest is kept; send it again whole.",
    "file": "The file cannot be read, or cannot be written where it should be; check its path and permissions.",
    "no_such_file": "The file is not there, or is not a file; check its path.",
    "nothing_to_read": "No exports were found; name files, or a folder that has some.",
    "output": "The results could not be written: the disk is full, or their reader is gone; make room, run it again.",
    "output_is_input": "The results would overwrite a file that is read; name another.",
    "outputs_same": "Two results would go to one file; name a file for each.",
    "same_file": "The file was named twice, by this or another path; it is read once.",
    "upload_failed": "The service could not use the file; the text says why.",
}
_OPTIONS = {
    "dry_run_sends": "`--again` sends the digest, and `--dry-run` only prints it; give one of them.",
    "judged_alone": "`--judged` takes part of the record, and a simulation covers all of it; give one of them.",
    "key_name": "A key needs a printable name that is not too long; give one.",
    "no_receiver": "Nobody is set to receive the digest; set LOOPAUDIT_DIGEST_MAIL_TO or LOOPAUDIT_DIGEST_WEBHOOKS.",
    "no_run": "No audit has ended yet that a digest could tell of; run `loopaudit nightly`.",
    "no_validation": "`--validate-op` and `--validate-pv` name columns of a `--validate` that is not given; give it.",
    "plot_form": "A plot is a page (.html) or a drawing (.svg); name the file accordingly.",
    "quick_alone": "`--quick` has no fit, which `--validate`, `--trace`, `--plot` and `--model` need; leave one out.",
    "run_goes_on": "The run has not ended, so it has no digest yet; wait for its end.",
    "unknown_key": "There is no key with that id; `loopaudit keys list` has all.",
    "which_report": "A report covers a loop or the plant; give either `--loop` or `--plant`.",
}
_ANSWERS = {
    "no_problem_details": "Something other than the service answers there, such as a proxy; check the address.",
    "no_service": (
        "Nothing answers at the address, or the answer breaks off; check that the service is running and reachable."
    ),
    "timeout": (
        "What was waited for has not finished in time and is still running; check that a worker runs, or wait longer."
    ),
    "url": "This is not the address of a service; give one such as http://127.0.0.1:8000.",
}
COMMAND_WORDS = {**_SERVICE, **_BACKUP, **_FILES, **_OPTIONS, **_ANSWERS}
