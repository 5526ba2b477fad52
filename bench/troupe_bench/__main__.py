"""Runs the benchmarks, part by part: what is there already is kept, so that a run that was stopped goes on."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from troupe_bench import crowd, machine, official, parts, programs, serving, words
from troupe_bench.programs import Failed, say
from troupe_bench.report import write_report
from troupe_bench.settings import Settings
from troupe_bench.store import Store
from troupe_bench.verify import verify

# The title of each part, and the function that measures it with the settings alone.
PARTS: dict[str, tuple[str, Callable[[Settings], None] | None]] = {
    "build": ("build the programs in release mode", lambda _: programs.build()),
    "verify": ("check that the Python servers solve the server's problems", verify),
    "tune": ("try settings of the Python servers", serving.tune),
    "serving": ("raw loop, server, LitServe and FastAPI in turns", None),
    "mixed": ("server and LitServe with segments of all lengths", serving.mixed),
    "live": ("live characters for minutes", crowd.live),
    "overload": ("five times what the server can do", crowd.overload),
    "words": ("motion of words: server and FastAPI in turns", words.measure),
    "ceiling": ("operations of a segment, and the machine's peak", parts.ceiling),
    "operators": ("time of the networks by kind of operator", parts.operators),
    "paper": ("packs of the paper's size", parts.paper),
    "official": ("NVIDIA's public code and Troupe with its networks, in turns (--official)", official.measure),
    "idle": ("CPU and memory of an idle server", parts.idle),
    "micro": ("criterion benches", parts.micro),
    "report": ("write bench/figures/MACHINE.json and docs/benchmarks.md", None),
}
WITHOUT_PACK = ("paper", "official", "micro")
"""Parts that do not measure the pack."""
ON_DEMAND = ("official",)
"""Parts that run only if they are named."""


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Reads the command line."""
    listed = "\n".join(f"  {name:<13}{text}" for name, (text, _) in PARTS.items())
    parser = argparse.ArgumentParser(
        prog="bench", description=f"{__doc__}\n\nparts:\n{listed}", formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help="parts to run; if none is named all but " + ", ".join(ON_DEMAND)
    )
    parser.add_argument("--quick", action="store_true", help="short runs, once each; kept apart from full ones")
    parser.add_argument("--fresh", action="store_true", help="forget earlier results of these parts")
    parser.add_argument("--repeats", type=int, help="turns of each measurement")
    parser.add_argument("--engines", help="cpu, openvino-bf16 or both with a comma; those that run here if left out")
    parser.add_argument("--targets", default=",".join(serving.TARGETS), help="of the serving part")
    parser.add_argument("--pack", type=Path, help="folder of the pack")
    parser.add_argument(
        "--official", type=Path, help="checkout of NVlabs/GR00T-WholeBodyControl, for the part of that name"
    )
    parser.add_argument("--train-python", type=Path, help="Python with PyTorch, for packs of the paper's size")
    parser.add_argument(
        "--machine", default="", help="file name of this machine's figures; from its processor if left out"
    )
    parser.add_argument("--out", type=Path, help="page to write")
    parser.add_argument("--time", action="store_true", help="only say how long the serving part takes")
    args = parser.parse_args(arguments)
    unknown = [part for part in args.parts if part not in PARTS]
    if unknown:
        parser.error(f"no part {unknown[0]}; there are {', '.join(PARTS)}")
    return args


def settings_of(args: argparse.Namespace) -> Settings:
    """The settings that the command line asks for."""
    settings = Settings()
    if args.quick:
        settings.shorten()
    settings.repeats = args.repeats or settings.repeats
    settings.pack = args.pack.resolve() if args.pack else settings.pack
    settings.official = args.official.resolve() if args.official else None
    settings.train_python = args.train_python or settings.train_python
    wanted = args.engines.split(",") if args.engines else [e for e in settings.engines if runs_here(e)]
    settings.engines = tuple(wanted)
    return settings


def runs_here(engine: str) -> bool:
    """Whether the engine's library is there and the processor computes in its precision."""
    has_bf16 = {"avx512_bf16", "amx_bf16"} & set(machine.cpu_facts()[1])
    return programs.runtime_library(engine) is not None and (engine == "cpu" or bool(has_bf16))


def run_part(part: str, settings: Settings, args: argparse.Namespace) -> None:
    """Runs one part."""
    run = PARTS[part][1]
    if run is not None:
        run(settings)
    elif part == "serving":
        serving.serving(settings, tuple(args.targets.split(",")))
    else:
        page = settings.results / "benchmarks.md" if settings.quick else machine.ROOT / "docs/benchmarks.md"
        write_report(settings, args.out or page, args.machine)
        say(f"written: {args.out or page}")


def begin(part: str, settings: Settings, fresh: bool) -> None:
    """Notes what a part is measured on, and forgets what was measured of another pack."""
    facts = machine.describe() | {"pack": machine.pack_id(settings.pack)}
    Store.commit = facts["commit"]
    Store(settings.results, "machine").note("machine", facts)
    store = Store(settings.results, part)
    if fresh:
        store.clear()
    pack = machine.pack_id(settings.words_pack) if part == "words" else facts["pack"]
    if part not in WITHOUT_PACK and store.of_pack(pack):
        say("what was measured of another pack is forgotten")


def main(arguments: list[str] | None = None) -> int:
    """Runs the parts; a part that fails does not keep the others from running."""
    args = parse(arguments)
    settings = settings_of(args)
    minutes = serving.estimate_s(settings, tuple(args.targets.split(","))) / 60
    say(f"engines: {', '.join(settings.engines)}; the serving part takes about {minutes:.0f} minutes")
    if args.time:
        return 0
    failed = []
    for part in args.parts or [part for part in PARTS if part not in ON_DEMAND]:
        say(f"== {part}: {PARTS[part][0]}")
        if part not in ("build", "verify", "report"):
            begin(part, settings, args.fresh)
        try:
            run_part(part, settings, args)
        except Failed as error:
            say(f"{part} failed: {error}")
            failed.append(part)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
