"""What can be asked of a worker. Reading and sweeping have queues of their own, so that no long run holds them up."""

READ_UPLOAD = "loopaudit.read_upload"
AUDIT_CHUNK = "loopaudit.audit_chunk"
EXPLAIN = "loopaudit.explain"
DELIVER = "loopaudit.deliver"
SWEEP = "loopaudit.sweep"

QUEUE_OF = {SWEEP: "control", READ_UPLOAD: "reading", AUDIT_CHUNK: "audit", EXPLAIN: "explain", DELIVER: "deliver"}
QUEUES = tuple(QUEUE_OF.values())
