"""The four stages of a MotionBricks pack: tokenizer, root, pose, refine."""
