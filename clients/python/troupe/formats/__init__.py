"""Files: BVH, glTF, CSV of robots, and numpy archives."""
