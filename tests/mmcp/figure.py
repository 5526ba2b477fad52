"""Times a request for several samples in one batch and one request per sample, in turns."""

import argparse
import json
import os
import statistics
import time
import urllib.request

from motionmcp.client import get_capabilities, pick_model


def ask(url: str, body: dict) -> float:
    """Seconds until the whole answer has arrived."""
    data = json.dumps(body).encode()
    request = urllib.request.Request(url + "/generate", data, {"Content-Type": "application/json"})
    begun = time.perf_counter()
    with urllib.request.urlopen(request, timeout=600) as answer:
        answer.read()
    return time.perf_counter() - begun


def main() -> None:
    """Prints one line per model."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url", default=os.environ.get("TROUPE_SERVER", "http://127.0.0.1:8080"))
    parser.add_argument("--models", nargs="+", default=["human", "g1", "unimogen/horse"])
    parser.add_argument("--samples", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--rounds", type=int, default=7)
    args = parser.parse_args()
    capabilities = get_capabilities(args.url, use_cache=False)
    for name in args.models:
        model = pick_model(capabilities, name)
        frames = round(args.seconds * model["fps"])

        def body(seed: int, samples: int, model: dict = model, frames: int = frames) -> dict:
            return {
                "protocol_version": "1.4",
                "model": model["id"],
                "skeleton": model["canonical_skeleton"],
                "segments": [{"type": "unconditioned", "duration_frames": frames}],
                "options": {"seed": seed, "num_samples": samples},
            }

        ask(args.url, body(0, args.samples))
        together, apart = [], []
        for seed in range(args.rounds):
            together.append(ask(args.url, body(seed, args.samples)))
            apart.append(sum(ask(args.url, body(seed * args.samples + nth, 1)) for nth in range(args.samples)))
        one, many = statistics.median(together), statistics.median(apart)
        print(
            f"{model['id']}: {args.samples} samples of {args.seconds:g} s: {one * 1000:.0f} ms in one batch, "
            f"{many * 1000:.0f} ms one at a time ({many / one:.1f} times); medians of {args.rounds} rounds"
        )


if __name__ == "__main__":
    main()
