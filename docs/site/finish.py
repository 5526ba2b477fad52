"""Makes the pages of the site load nothing from elsewhere: python finish.py SITE.

The generator names a script on a public host, which searches from files need. Ours lies beside the pages.
"""

import os
import re
import sys
from pathlib import Path

SHIM = "https://unpkg.com/iframe-worker/shim"
LOADED = re.compile(
    r"""<(?:script|img|iframe)[^>]*\ssrc=["']?((?:https?:)?//[^"'\s>]+)|<link[^>]*\shref=["']?((?:https?:)?//[^"'\s>]+)"""
)


def main(site: Path) -> None:
    """Turns the script's address on all pages, and looks for others."""
    faults = []
    for page in sorted(site.rglob("*.html")):
        text = page.read_text().replace(SHIM, os.path.relpath(site / "iframe-worker.js", page.parent))
        page.write_text(text)
        faults += [f"{page.relative_to(site)} loads {found[1] or found[2]}" for found in LOADED.finditer(text)]
    if faults:
        raise SystemExit("\n".join(faults))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
