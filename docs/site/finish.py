"""Checks the site, and leaves out what no page loads: python finish.py SITE.

Pages must load nothing from elsewhere, and the site must be small.
"""

import re
import shutil
import sys
from pathlib import Path

LOADED = re.compile(
    r"""<(?:script|img|iframe)[^>]*\ssrc=["']?((?:https?:)?//[^"'\s>]+)|<link[^>]*\shref=["']?((?:https?:)?//[^"'\s>]+)"""
)
# Every server carries the site.
MOST_BYTES = 11_300_000
# The generator's other look.
UNUSED = "assets/stylesheets/classic"


def main(site: Path) -> None:
    """Looks through all pages."""
    faults = []
    shutil.rmtree(site / UNUSED)
    for page in sorted(site.rglob("*.html")):
        text = page.read_text()
        if UNUSED in text:
            faults.append(f"{page.relative_to(site)} needs {UNUSED}")
        found = LOADED.finditer(text)
        faults += [f"{page.relative_to(site)} loads {one[1] or one[2]}" for one in found]
    size = sum(file.stat().st_size for file in site.rglob("*") if file.is_file())
    if size > MOST_BYTES:
        faults.append(f"the site has {size} bytes, allowed are {MOST_BYTES}")
    if faults:
        raise SystemExit("\n".join(faults))
    print(f"{sum(1 for _ in site.rglob('*.html'))} pages, {size / 1e6:.1f} MB")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
