"""Motion as training reads it: BVH files, skeletons, rotations, clips cut and cached, segments drawn from the cache."""
