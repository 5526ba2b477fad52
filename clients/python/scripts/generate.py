"""Writes troupe/v1 from the contract in proto/, or with --check says whether it is up to date.

The names of the messages' modules are those of the contract's package, so nothing in the generated files is edited.
"""

import argparse
import filecmp
import shutil
import sys
import tempfile
from importlib.resources import files
from pathlib import Path

from grpc_tools import protoc

HERE = Path(__file__).resolve().parent.parent
PROTO = HERE.parent.parent / "proto"
PACKAGE = Path("troupe/v1")


def generate(into: Path) -> list[Path]:
    """Runs protoc and gives the paths of the files that it wrote, relative to `into`."""
    sources = sorted(str(path.relative_to(PROTO)) for path in (PROTO / PACKAGE).glob("*.proto"))
    common = str(files("grpc_tools") / "_proto")
    arguments = ["protoc", f"-I{PROTO}", f"-I{common}", f"--python_out={into}", f"--pyi_out={into}", *sources]
    if protoc.main(arguments) != 0:
        raise SystemExit("protoc failed")
    return sorted(path.relative_to(into) for path in (into / PACKAGE).iterdir())


def outdated(fresh: Path, names: list[Path]) -> list[Path]:
    """The generated files that differ from those in the package, are missing there, or have no source any more."""
    there = {path.relative_to(HERE) for path in (HERE / PACKAGE).glob("*_pb2*")}
    differing = {
        name for name in names if not (HERE / name).exists() or not filecmp.cmp(fresh / name, HERE / name, False)
    }
    return sorted(differing | there.difference(names))


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="change nothing; fail where something is not up to date")
    check = parser.parse_args().check
    with tempfile.TemporaryDirectory() as folder:
        fresh = Path(folder)
        names = generate(fresh)
        changed = outdated(fresh, names)
        if check:
            for name in changed:
                print(f"{name} is not what the contract gives; run {Path(__file__).name}", file=sys.stderr)
            return 1 if changed else 0
        for name in changed:
            (HERE / name).unlink(missing_ok=True)
            if name in names:
                shutil.copyfile(fresh / name, HERE / name)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
