"""Flying on the air: one drone's process, the operator's station, what was flown."""
