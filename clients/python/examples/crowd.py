"""Fifty characters wander about for five seconds: python crowd.py [ADDRESS]."""

import sys

import numpy as np

import troupe

with troupe.Client(*sys.argv[1:2]) as client, client.crowd(50) as crowd:
    heading = np.random.default_rng(7).uniform(-np.pi, np.pi, 50)
    for tick in range(150):
        heading += 0.02 * np.sin(0.05 * tick + np.arange(50))
        crowd.walk(1.2 * np.stack([np.sin(heading), 0 * heading, np.cos(heading)], axis=1))
        frames = crowd.step().frames
    print(f"after {tick + 1} ticks the first one's hips are at {frames.world_positions()[-1, 0, 0].round(2)}")
