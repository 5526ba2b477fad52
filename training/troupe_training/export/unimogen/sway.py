"""The table ``[sway]`` at the end of a body's file in a pack."""

import json
from pathlib import Path
from typing import Any

from troupe_training.export.manifest import lines_without

COMMENT = "# Written by `troupe-train unimogen sway`: how the root moves about its way, by gait and speed."


def write_sway(pack: Path, body: str, table: dict[str, Any]) -> None:
    """Writes the table of a body, instead of one that is there; an empty table removes it."""
    path = pack / "bodies" / f"{body}.toml"
    lines = lines_without(path.read_text(encoding="utf-8"), "sway", COMMENT)
    if table:
        lines += ["", COMMENT, "[sway]", f"feet = {json.dumps(table['feet'])}"]
        for gait in table["gaits"]:
            lines += ["", "[[sway.gaits]]", *(f"{key} = {json.dumps(value)}" for key, value in gait.items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
