"""No process outlives its test, whether that fails, is interrupted or is killed."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest
import test_routing
from processes import RUNNING, SETPRIV, Process, until

HERE = Path(__file__).parent
PARENT = """
import signal, sys, time
sys.path.insert(0, {here!r})
from pathlib import Path
from processes import Process
signal.signal(signal.SIGINT, signal.default_int_handler)  # What runs in the background may ignore it.
print(Process(["sleep", "600"], Path({log!r})).process.pid, flush=True)
time.sleep(600)
"""


def runs(pid: int) -> bool:
    """Whether a process is there, and is not only waiting to be collected."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):  # Before and while its file is read.
        return False
    return state not in "ZX"


@pytest.mark.skipif(
    not SETPRIV, reason="there is no setpriv (Debian: util-linux), which has processes end with their parent"
)
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_process_ends_with_the_test_that_started_it(tmp_path, how):
    script = PARENT.format(here=str(HERE), log=str(tmp_path / "log"))
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as parent:
        child = int(parent.stdout.readline())
        until(lambda: Path(f"/proc/{child}/comm").read_text() == "sleep\n", "setpriv has begun it", 5)
        parent.send_signal(how)
        try:
            until(lambda: not runs(child), "the process ends", 5)
        finally:
            parent.kill()


def test_a_cluster_that_cannot_begin_leaves_nothing(tmp_path, monkeypatch):
    before = set(RUNNING)

    def fails(*_):
        assert len(RUNNING - before) == 3, "the servers run"
        raise OSError("no router")

    monkeypatch.setattr(test_routing, "Router", fails)
    with pytest.raises(OSError, match="no router"):
        test_routing.Cluster("haproxy", tmp_path)
    assert before == RUNNING


def test_a_process_that_does_not_do_what_it_should_ends(tmp_path):
    one = Process(["sleep", "600"], tmp_path / "log")
    with pytest.raises(AssertionError), one.or_end():
        until(lambda: False, "it listens", 0.1)
    assert one.process.poll() is not None
    assert one not in RUNNING
