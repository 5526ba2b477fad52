"""Packs of MotionBricks networks, out of checkpoints and back into them."""
