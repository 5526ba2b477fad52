"""NVIDIA's public MotionBricks release as a pack, and the check against its code."""
