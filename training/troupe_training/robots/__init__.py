"""Robots: URDF, motion as CSV, and hinges within their limits."""
