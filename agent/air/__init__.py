"""A drone on the air: a vehicle in a room, peers for a radio, the time of day for a clock; no world."""
