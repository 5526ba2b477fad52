"""Conventions of data, networks and packs. Axes are right-handed, Y up, +Z forward; metres and radians."""

FPS = 30.0
CONTEXT_FRAMES = 4  # a segment's first frames, which are given
MAX_TARGETS = 4  # a segment's last frames, any of which may be given
MIN_FRAMES, MAX_FRAMES = 12, 64  # of a segment
LENGTH_STEP = 4  # training segments are multiples of it
