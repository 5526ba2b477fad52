"""Fills a gap of a clip, and one that knows only where to end: python fill_gap.py [ADDRESS [CLIP.bvh]]."""

import sys
from pathlib import Path

import troupe

WALK = Path(__file__).resolve().parents[3] / "examples" / "walk.bvh"

with troupe.Client(*sys.argv[1:2]) as client:
    pack = client.pack()
    clip = troupe.Clip.from_bvh(sys.argv[2] if len(sys.argv) > 2 else WALK).on(pack.skeleton)

    # Frames 27 to 30 are the context, frame 65 is the target; the networks make what lies between.
    gap = troupe.InBetween.from_clip(clip, 30, 65, seed=7)
    filled = client.in_between(gap, pack=pack).clip
    filled.to_bvh("filled.bvh")
    print(f"filled.bvh: {len(filled)} frames, the last exactly as in the clip")

    # A keyframe may give any part of a frame: here the place and the heading, but no pose. The
    # model chooses the length.
    ahead = troupe.Keyframe(root=clip.root[30] + (0, 0, 1.5), heading=0.0)
    reached = client.in_between(troupe.InBetween(clip[27:31], [ahead], seed=7), pack=pack).clip
    reached.to_glb("reached.glb")
    print(f"reached.glb: {len(reached)} frames to {reached.root[-1].round(3)}")
