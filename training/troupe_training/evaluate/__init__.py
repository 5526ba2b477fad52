"""Measures of generated motion, with intervals, as tables and as a pack's card."""
