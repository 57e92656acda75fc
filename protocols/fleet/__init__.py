"""What is flown where, on the air: the fleet file, and how a mission lies in a room."""
