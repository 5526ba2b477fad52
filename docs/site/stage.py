"""Puts the pages of the site into a folder for the generator: python stage.py OUT.

Pages link to files of the repository as they lie there. Here each file that a page links to gets a page too: Markdown as it is,
other text as a listing, folders as a list. Links are turned to those pages. A link to nothing is an error.
"""

import json
import os
import re
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
LINK = re.compile(r"(?<=\]\()([^()\s]+)(?=\))")
FENCE = re.compile(r"^(```|~~~)")
# Files that are longer are offered as they are.
LONGEST_LISTING = 64_000
LANGUAGES = {
    ".rs": "rust",
    ".py": "python",
    ".toml": "toml",
    ".proto": "protobuf",
    ".json": "json",
    ".yml": "yaml",
    ".yaml": "yaml",
}
PICTURES = {".png", ".svg", ".jpg"}


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
        """The name of a file's page."""
        within = source.relative_to(DOCS) if source.is_relative_to(DOCS) else "repository" / source.relative_to(ROOT)
        if source.is_dir():
            return within / "index.md"
        if source.name == "README.md":
            return within.with_name("index.md")
        return within if source.suffix == ".md" or not is_listed(source) else within.with_name(f"{source.name}.md")

    def fill(self) -> None:
        """Writes every page that is reached."""
        while self.waiting:
            source = self.waiting.pop()
            target = self.pages / self.placed[source]
            target.parent.mkdir(parents=True, exist_ok=True)
            if source.suffix == ".md":
                target.write_text(self.turned(source))
            elif source.is_dir():
                target.write_text(self.folder(source))
            elif is_listed(source):
                target.write_text(listing(source))
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


def is_listed(source: Path) -> bool:
    """Whether a file's text is shown on a page."""
    return source.is_file() and source.suffix not in PICTURES and source.stat().st_size <= LONGEST_LISTING


def listing(source: Path) -> str:
    """A page with a file's text."""
    text = source.read_text()
    fence = "`" * 4 if "```" in text else "```"
    return f"# {source.relative_to(ROOT)}\n\n{fence}{LANGUAGES.get(source.suffix, 'text')}\n{text.rstrip()}\n{fence}\n"


def title(page: Path) -> str:
    """A page's first heading."""
    text = page.read_text()
    heading = re.search(r"^# (.+)$", text, re.MULTILINE) or re.search(r"<h1[^>]*>(.+?)</h1>", text)
    if heading is None:
        raise SystemExit(f"{page} has no heading")
    return heading[1].replace("`", "")


def navigation(stage: Stage) -> list[dict[str, object]]:
    """The sections of docs/README.md with their pages. A record of all records stands before them."""
    sections: list[dict[str, object]] = [{"Troupe": "index.md"}]
    pages: list[dict[str, str]] = []
    for line in (DOCS / "README.md").read_text().splitlines():
        if section := re.match(r"\| \*\*(.+)\*\* \|", line):
            pages = []
            sections.append({section[1]: pages})
        elif line.startswith("| ["):
            for link in LINK.findall(line.split("|")[1]):
                page = (DOCS / link.partition("#")[0]).resolve()
                pages.append({title(page): str(stage.place(page))})
                if page == DOCS / "decisions/README.md":
                    records = [page.parent / record for record in LINK.findall(page.read_text())]
                    pages += [{title(record): str(stage.place(record))} for record in records]
    return sections


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
    for own in ("site.css", "iframe-worker.js"):
        shutil.copyfile(DOCS / "site" / own, stage.pages / own)
    text = (DOCS / "site/zensical.toml").read_text().replace("[project]\n", f"[project]\nnav = {toml(nav)}\n", 1)
    (out / "zensical.toml").write_text(text)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
