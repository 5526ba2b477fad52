#!/usr/bin/env python3
"""Checks how the repository reads: phrases that are not used, comments of 100 columns, comments that repeat a name.

Single words that are not used stand in typos.toml. Usage: scripts/check-prose.py [FILE or FOLDER ...]
"""

import re
import subprocess
import sys
from pathlib import Path

COMMENT_COLUMNS = 100
ENDINGS = (".rs", ".proto", ".py", ".ts", ".md", ".toml", ".sh", ".yaml", ".html", ".css")
# Made by commands of the repository, or other people's words.
LEFT_OUT = re.compile(
    r"^(web/dist/|web/src/reader/|docs/references/|scripts/check-prose\.py$|typos\.toml$|.*_pb2|training/splits/|LICENSE|.*lock)"
)

# Each phrase with what to write instead.
PHRASES = {
    r"\bwhere (it|there|they|that|this|one|he|she) (is|are|was|were|has|have|had)\b": "if …, or name the case",
    r"\bas good as\b": "almost, or say how much",
    r"\bthere (is|are) (one|none):": "say what there is",
    r"\bso (many|much) (that|as)\b": "say how many",
    r"\bwhat (is|was|has been|are|were) (said|given|asked) (it|them|him)\b": "say who gets what",
    r"\bnext to (none|nothing|never)\b": "almost none",
    r"\bis nothing's\b": "does not exist",
}
MARKERS = r"//!|///|//|#(?!!?\[)"
COMMENT = re.compile(rf"^\s*(?:{MARKERS})")
REPEATS = re.compile(r"^\s*/// (?:Its|Their|The|A|An|His) ((?:[A-Za-z]+ ?){1,3})\.$")
ITEM = re.compile(
    r"^\s*(?:pub(?:\([^)]*\))? )?(?:const |async |unsafe )*"
    r"(?:fn |struct |enum |trait |mod |type |static )?(?:r#)?([A-Za-z_]\w*)"
)


def words(name):
    """The words of an identifier or a phrase, lower case, without plurals."""
    parts = re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", name)
    return [part.lower().rstrip("s") for part in parts]


def problems(name, text):
    """Line number and problem of everything that is wrong in a file."""
    lines = text.split("\n")
    fence = False
    for number, line in enumerate(lines, 1):
        for phrase, instead in PHRASES.items():
            for match in re.finditer(phrase, line, re.IGNORECASE):
                yield number, f"“{match[0]}”: {instead}"
        if not name.endswith((".rs", ".proto", ".py", ".ts")):
            continue
        if not COMMENT.match(line):
            fence = False
            continue
        if "```" in line:
            fence = not fence
        # Drawings, tables and commands keep their width.
        drawn = fence or re.search(r"[│─┌└►▼]|\|.*\||https?://", line) or re.match(rf"^\s*(?:{MARKERS})\s{{4,}}", line)
        if len(line) > COMMENT_COLUMNS and not drawn:
            yield number, f"a comment of {len(line)} columns; allowed: {COMMENT_COLUMNS}"
        repeat = REPEATS.match(line)
        if repeat and number < len(lines):
            below = next((row for row in lines[number:] if not row.strip().startswith("#[")), "")
            item = ITEM.match(below)
            if item and words(repeat[1]) == words(item[1]):
                yield number, f"“{line.strip()}” repeats the name `{item[1]}`: say a unit, a range or who sets it"


def main():
    """Prints what is wrong and fails if anything is."""
    listed = subprocess.run(["git", "ls-files", "--", *sys.argv[1:]], capture_output=True, text=True, check=True)
    found = 0
    for name in listed.stdout.split("\n"):
        if not name.endswith(ENDINGS) or LEFT_OUT.match(name) or not Path(name).is_file():
            continue
        for number, problem in problems(name, Path(name).read_text(encoding="utf-8", errors="replace")):
            print(f"{name}:{number}: {problem}")
            found += 1
    if found:
        sys.exit(f"check-prose: {found} places")


if __name__ == "__main__":
    main()
