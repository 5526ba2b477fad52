"""Training of UniMoGen."""
