"""Equal shares of the machine's processors for servers that are measured."""

import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

SERVERS = 3
CGROUPS = Path("/sys/fs/cgroup")
PERIOD_US = 10_000
"""A server that has used its share up waits for less than this: a third of a frame."""
BESIDE_CORES = 0.8
"""What routers, Redis and the load get at least, where servers have quotas."""
RUN_WITHIN = 'echo $$ >"$0/cgroup.procs" && exec "$@"'


@dataclass(frozen=True)
class Shares:
    """Each prefix goes before a server's command. `words` say what a server gets."""

    prefixes: list[list[str]]
    words: str


@contextmanager
def equal_shares(cores_each: float | None) -> Iterator[Shares]:
    """Cores of its own for each server if there are four or more, and otherwise, or if it is named, a quota."""
    here = sorted(os.sched_getaffinity(0))
    if cores_each is None and len(here) > SERVERS and shutil.which("taskset"):
        try:
            yield pinned(here)
        finally:
            os.sched_setaffinity(0, here)
        return
    with ExitStack() as stack:
        cores = cores_each or round((len(here) - BESIDE_CORES) / SERVERS, 2)
        groups = [stack.enter_context(quota(f"troupe-{nth}", cores)) for nth in range(SERVERS)]
        prefixes = [["sh", "-c", RUN_WITHIN, str(group)] for group in groups]
        yield Shares(prefixes, f"{cores:g} cores of {len(here)}, by quota")


def pinned(here: list[int]) -> Shares:
    """Pins servers to cores of their own, and this process and all that it starts to the others."""
    each = (len(here) - 1) // SERVERS
    lists = [here[nth * each : (nth + 1) * each] for nth in range(SERVERS)]
    others = here[SERVERS * each :]
    os.sched_setaffinity(0, others)
    prefixes = [["taskset", "--cpu-list", ",".join(map(str, cores))] for cores in lists]
    return Shares(prefixes, f"{each} of {len(here)} cores, pinned")


@contextmanager
def quota(name: str, cores: float) -> Iterator[Path]:
    """A control group whose processes get this number of cores together."""
    is_v2 = (CGROUPS / "cgroup.controllers").exists()
    group = (CGROUPS if is_v2 else CGROUPS / "cpu") / name
    limit_us = round(PERIOD_US * cores)
    try:
        group.mkdir(exist_ok=True)
        if is_v2:
            (CGROUPS / "cgroup.subtree_control").write_text("+cpu")
            (group / "cpu.max").write_text(f"{limit_us} {PERIOD_US}")
        else:
            (group / "cpu.cfs_period_us").write_text(str(PERIOD_US))
            (group / "cpu.cfs_quota_us").write_text(str(limit_us))
    except OSError as error:
        raise SystemExit(f"{group}: {error}; equal shares need four cores, or root and control groups") from error
    try:
        yield group
    finally:
        group.rmdir()
