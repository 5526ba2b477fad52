"""Packs of VerMo."""
