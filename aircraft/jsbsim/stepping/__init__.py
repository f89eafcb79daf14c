"""Steps the aircraft of a fleet: in this process, or in several over shared memory."""
