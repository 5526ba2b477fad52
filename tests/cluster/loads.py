"""The load tester of the repository, as figures use it."""

import json
import os
import subprocess
from pathlib import Path

from processes import Process
from routers import ROOT

LOADTEST = Path(os.environ.get("TROUPE_LOADTEST") or ROOT / "target/release/troupe-loadtest")


def lacking() -> str | None:
    """What figures lack on this machine."""
    return None if LOADTEST.exists() else f"there is no {LOADTEST}: cargo build --release --package troupe-loadtest"


class Load(Process):
    """A run of the load tester that writes a report."""

    def __init__(self, command: list[str], address: str, file: Path):
        self.file = file
        arguments = [str(LOADTEST), *command, "--server", f"http://{address}", "--quiet", "--json", str(file)]
        super().__init__(arguments, file.with_suffix(".log"))

    def report(self, most_s: float | None = None) -> dict | None:
        """Waits for its end, `most_s` at most. None if it has no report; its output is printed then."""
        try:
            self.process.wait(most_s)
        except subprocess.TimeoutExpired:
            print(f"stopped after {most_s:.0f} s", flush=True)
        finally:
            self.kill()
        if self.file.exists():
            return json.loads(self.file.read_text())
        print(f"{subprocess.list2cmdline(map(str, self.command))}\n{self.log.read_text()}", flush=True)
        return None
