"""The command line, ``troupe-train``."""
