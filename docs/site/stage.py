"""Puts the pages of the site into a folder for the generator: python stage.py OUT.

Pages link to files of the repository as they lie there. Markdown becomes a page, a picture becomes a smaller one, and other files
are offered as plain text. A folder becomes a list of its files. Links are turned to those. A link to nothing is an error.
"""

import json
import os
import re
import shutil
import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
LINK = re.compile(r"(?<=\]\()([^()\s]+)(?=\))")
NAMED = re.compile(r"\[([^\]]+)\]\(([^()\s]+\.md)\)")
RECORDS = "decisions/README.md"
FENCE = re.compile(r"^(```|~~~)")
# Of WebP, 0 to 100: lines and letters of plots stay sharp. What moves is large, and looked at less
# closely.
QUALITY, MOVING_QUALITY = 80, 30
MOST_WIDTH = 1600
# Pictures that stay as they are.
PICTURES = {".svg", ".jpg", ".webp"}


class Stage:
    """The folder that is filled, and what it still lacks."""

    def __init__(self, pages: Path) -> None:
        self.pages = pages
        self.placed: dict[Path, Path] = {}
        self.waiting: list[Path] = []
        self.faults: list[str] = []

    def place(self, source: Path) -> Path:
        """Where the site has a file of the repository, relative to its pages."""
        if source.is_dir() and (source / "README.md").is_file():
            source = source / "README.md"
        if source not in self.placed:
            self.placed[source] = self.name(source)
            self.waiting.append(source)
        return self.placed[source]

    def name(self, source: Path) -> Path:
        """The name of what stands for a file."""
        within = source.relative_to(DOCS) if source.is_relative_to(DOCS) else "repository" / source.relative_to(ROOT)
        if source.is_dir():
            return within / "index.md"
        if source.name == "README.md":
            return within.with_name("index.md")
        if source.suffix in {".md", ".txt", *PICTURES}:
            return within
        return within.with_suffix(".webp") if source.suffix == ".png" else within.with_name(f"{source.name}.txt")

    def fill(self) -> None:
        """Writes every page that is reached."""
        while self.waiting:
            source = self.waiting.pop()
            target = self.pages / self.placed[source]
            target.parent.mkdir(parents=True, exist_ok=True)
            if source.is_dir():
                target.write_text(self.folder(source))
            elif source.suffix == ".md":
                target.write_text(self.turned(source))
            elif source.suffix == ".png":
                shrink(source, target)
            else:
                shutil.copyfile(source, target)

    def turned(self, source: Path) -> str:
        """A page with its links turned. Code keeps its brackets."""
        lines, fenced = [], False
        for line in source.read_text().splitlines():
            fenced ^= bool(FENCE.match(line.strip()))
            code = fenced or line.startswith("    ")
            lines.append(line if code else LINK.sub(lambda link: self.link(source, link[1]), line))
        return "\n".join(lines) + "\n"

    def link(self, source: Path, link: str) -> str:
        """A link of a page as the site has it."""
        if re.match(r"[a-z]+:", link) or link.startswith("#"):
            return link
        path, _, anchor = link.partition("#")
        wanted = Path(os.path.normpath(source.parent / path))
        if not wanted.exists() or not wanted.is_relative_to(ROOT):
            self.faults.append(f"{source.relative_to(ROOT)}: {link} leads nowhere")
            return link
        found = os.path.relpath(self.place(wanted), self.placed[source].parent)
        return f"{found}#{anchor}" if anchor else found

    def folder(self, source: Path) -> str:
        """A page with a folder's files."""
        here = self.placed[source].parent
        files = [file for file in sorted(source.iterdir()) if file.is_file() and not file.name.startswith(".")]
        links = [f"- [{file.name}]({os.path.relpath(self.place(file), here)})" for file in files]
        return f"# {source.relative_to(ROOT)}\n\n" + "\n".join(links) + "\n"


def shrink(source: Path, target: Path) -> None:
    """Writes a picture as WebP, with all frames of one that moves."""
    picture = Image.open(source)
    moves = getattr(picture, "n_frames", 1) > 1
    if not moves:
        picture.thumbnail((MOST_WIDTH, picture.height))
    picture.save(target, quality=MOVING_QUALITY if moves else QUALITY, method=4, save_all=moves)


def navigation(stage: Stage) -> list[dict[str, object]]:
    """The sections of docs/README.md with their pages, and below the list of decisions its records."""
    sections: list[dict[str, object]] = [{"Overview": "index.md"}]
    pages: list[dict[str, object]] = []
    for line in (DOCS / "README.md").read_text().splitlines():
        if line.startswith("## "):
            pages = []
            sections.append({line.removeprefix("## "): pages})
        elif line.startswith("| ["):
            for name, page in NAMED.findall(line.split("|")[1]):
                place = str(stage.place((DOCS / page).resolve()))
                pages.append({name: [place, *records(stage)] if page == RECORDS else place})
    return sections


def records(stage: Stage) -> list[dict[str, object]]:
    """The records of decisions, in the order of their list."""
    page = DOCS / RECORDS
    return [{name: str(stage.place(page.parent / record))} for name, record in NAMED.findall(page.read_text())]


def toml(value: object) -> str:
    """A value of the navigation in TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


def main(out: Path) -> None:
    """Fills the folder."""
    shutil.rmtree(out, ignore_errors=True)
    stage = Stage(out / "pages")
    stage.place(DOCS / "README.md")
    nav = navigation(stage)
    stage.fill()
    unreached = [page for page in DOCS.rglob("*.md") if page not in stage.placed]
    stage.faults += [f"no page links to {page.relative_to(ROOT)}" for page in sorted(unreached)]
    if stage.faults:
        raise SystemExit("\n".join(stage.faults))
    for own in ("site.css", "mark.svg"):
        shutil.copyfile(DOCS / "site" / own, stage.pages / own)
    text = (DOCS / "site/zensical.toml").read_text().replace("[project]\n", f"[project]\nnav = {toml(nav)}\n", 1)
    (out / "zensical.toml").write_text(text)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
