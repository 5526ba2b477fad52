import subprocess
import sys

from conftest import ROOT


def test_generated_modules_are_what_the_contract_gives() -> None:
    script = ROOT / "clients" / "python" / "scripts" / "generate.py"
    done = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
