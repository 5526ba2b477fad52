"""Packs of UniMoGen."""
