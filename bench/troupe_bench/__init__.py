"""Troupe's benchmarks: Python servers of the same networks, and the driver that measures them side by side."""
