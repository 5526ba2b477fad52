"""MotionBricks (Wang et al. 2026): multi-head tokenizer, root module, pose module, and the stages that a pack ships."""
