"""NVIDIA's public MotionBricks networks: our implementation of them, and their names for its weights."""
