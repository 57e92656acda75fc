"""The live page of a flight: who serves it (site, server), the flight's end of it (window), what is kept (recording)."""
