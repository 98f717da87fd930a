"""What people state of loops, taken and kept: what a loop is and was called, notes, repairs, shelving."""
