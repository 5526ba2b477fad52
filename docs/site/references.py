"""Writes docs/references from the sources that hold the words: python references.py [--check].

- messages: the comments of proto/troupe/v1
- HTTP: server/openapi.json, which a test holds to the code
- configuration: server/config.toml, which a test holds to the code
- commands: the snapshots of their help
"""

import json
import re
import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import grpc_tools
from google.protobuf.descriptor_pb2 import DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
from grpc_tools import protoc

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "docs/references"
MADE = "`scripts/docs.sh references` makes this page from {}.\n"
# Field numbers of descriptor.proto, of which paths to comments are made.
MESSAGES, ENUMS, SERVICES = 4, 5, 6
FIELDS, NESTED_MESSAGES, NESTED_ENUMS, CHOICES = 2, 3, 4, 8
METHODS = VALUES = 2


def cell(text: str) -> str:
    """Text for a cell of a table."""
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """A table, or nothing if there are no rows."""
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *lines]) + "\n" if lines else ""


# ---- Messages ----


class Proto:
    """One file of proto/, with its comments."""

    def __init__(self, file: FileDescriptorProto) -> None:
        self.file = file
        self.comments = {tuple(place.path): place for place in file.source_code_info.location}

    def comment(self, *path: int) -> str:
        """What stands before or behind a declaration."""
        place = self.comments.get(path)
        return place.leading_comments + place.trailing_comments if place else ""

    def head(self) -> str:
        """What stands before the file's first statement."""
        place = self.comments.get((12,))
        return "".join([*place.leading_detached_comments, place.leading_comments]) if place else ""

    def page(self) -> Iterator[str]:
        """The parts of the file's reference."""
        yield f"## {Path(self.file.name).name}\n"
        yield prose(self.head())
        for number, service in enumerate(self.file.service):
            yield f"### service {service.name}\n"
            yield prose(self.comment(SERVICES, number))
            rows = []
            for index, method in enumerate(service.method):
                asked = ("stream " if method.client_streaming else "") + short(method.input_type)
                answered = ("stream " if method.server_streaming else "") + short(method.output_type)
                meaning = cell(self.comment(SERVICES, number, METHODS, index))
                rows.append((f"`{method.name}`", asked, answered, meaning))
            yield table(("call", "request", "answer", "meaning"), rows)
        for number, message in enumerate(self.file.message_type):
            yield from self.message(message, (MESSAGES, number), "")
        for number, enum in enumerate(self.file.enum_type):
            yield from self.enum(enum, (ENUMS, number), "")

    def message(self, message: DescriptorProto, path: tuple[int, ...], outer: str) -> Iterator[str]:
        """A message and those within it."""
        if message.options.map_entry:
            return
        name = outer + message.name
        yield f"### {name}\n"
        yield prose(self.comment(*path))
        maps = {entry.name: entry for entry in message.nested_type if entry.options.map_entry}
        rows = []
        for number, field in enumerate(message.field):
            meaning = self.comment(*path, FIELDS, number)
            if field.HasField("oneof_index") and not field.proto3_optional:
                choice = message.oneof_decl[field.oneof_index].name
                meaning = f"One of `{choice}`. {meaning}"
            rows.append((f"`{field.name}`", kind(field, maps), str(field.number), cell(meaning)))
        yield table(("field", "type", "number", "meaning"), rows)
        for number, inner in enumerate(message.nested_type):
            yield from self.message(inner, (*path, NESTED_MESSAGES, number), f"{name}.")
        for number, enum in enumerate(message.enum_type):
            yield from self.enum(enum, (*path, NESTED_ENUMS, number), f"{name}.")

    def enum(self, enum: Any, path: tuple[int, ...], outer: str) -> Iterator[str]:
        """An enumeration."""
        yield f"### {outer}{enum.name}\n"
        yield prose(self.comment(*path))
        values = enumerate(enum.value)
        rows = ((f"`{value.name}`", str(value.number), cell(self.comment(*path, VALUES, n))) for n, value in values)
        yield table(("value", "number", "meaning"), rows)


def prose(comment: str) -> str:
    """A comment as a paragraph."""
    return (
        "\n".join(line.strip() for line in comment.replace("<", "&lt;").splitlines()).strip() + "\n" if comment else ""
    )


def short(name: str) -> str:
    """A message's name with a link, or that of another package."""
    name = name.removeprefix(".")
    own = name.removeprefix("troupe.v1.")
    return f"[{own}](#{own.lower().replace('.', '')})" if own != name else f"`{name}`"


def kind(field: FieldDescriptorProto, maps: dict[str, DescriptorProto]) -> str:
    """A field's type."""
    last = field.type_name.rpartition(".")[2]
    if last in maps:
        key, value = maps[last].field
        return f"map of {kind(key, {})} to {kind(value, {})}"
    name = short(field.type_name) if field.type_name else FieldDescriptorProto.Type.Name(field.type)[5:].lower()
    if field.label == FieldDescriptorProto.LABEL_REPEATED:
        return f"repeated {name}"
    return f"optional {name}" if field.proto3_optional else name


def messages() -> str:
    """The reference of messages."""
    files = sorted(str(file.relative_to(ROOT / "proto")) for file in (ROOT / "proto/troupe/v1").glob("*.proto"))
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "descriptors"
        known = Path(grpc_tools.__file__).parent / "_proto"
        options = [f"-I{ROOT / 'proto'}", f"-I{known}", "--include_source_info", f"--descriptor_set_out={out}"]
        if protoc.main(["protoc", *options, *files]) != 0:
            raise SystemExit("protoc failed")
        described = FileDescriptorSet.FromString(out.read_bytes())
    parts = ["# gRPC\n", MADE.format("the comments of `proto/troupe/v1`")]
    for file in described.file:
        parts += Proto(file).page()
    return "\n".join(part for part in parts if part)


# ---- HTTP ----


def shape(schema: dict[str, Any]) -> str:
    """What a schema is, in a word."""
    if "$ref" in schema:
        return f"`{schema['$ref'].rpartition('/')[2]}`"
    if schema.get("type") == "array":
        return f"list of {shape(schema['items'])}"
    for several in ("oneOf", "anyOf", "allOf"):
        if several in schema:
            return " or ".join(shape(one) for one in schema[several])
    names = schema.get("type", "any")
    return " or ".join(names) if isinstance(names, list) else str(names)


def body(holder: dict[str, Any]) -> str:
    """What a request or an answer holds."""
    return ", ".join(
        f"{shape(content.get('schema', {}))}, {kind}" for kind, content in holder.get("content", {}).items()
    )


# Groups of paths whose names are not just their tag with a capital.
NAMES = {"mmcp": "MMCP"}


def http() -> str:
    """The reference of paths."""
    document = json.loads((ROOT / "server/openapi.json").read_text())
    parts = ["# HTTP\n", MADE.format("`server/openapi.json`")]
    parts.append(
        "A running server has this as a page to try calls on at `/docs/api/`, and as a document at `/openapi.json`.\n"
        "Messages are those of [gRPC](grpc.md) as JSON. [Single requests](../requests.md) explains conventions and errors.\n"
    )
    groups: dict[str, list[str]] = {}
    for path, methods in document["paths"].items():
        for method, call in methods.items():
            lines = groups.setdefault(call["tags"][0], [])
            lines += [f"### `{method.upper()} {path}`\n", f"{call['summary']}.\n"]
            if "description" in call:
                lines.append(call["description"] + "\n")
            rows = []
            for one in call.get("parameters", []):
                rows.append((f"`{one['name']}`", one["in"], shape(one["schema"]), cell(one.get("description", ""))))
            lines.append(table(("parameter", "in", "type", "meaning"), rows))
            if "requestBody" in call:
                lines.append(f"Body: {body(call['requestBody'])}.\n")
            answers = call["responses"].items()
            rows = [(status, body(answer), cell(answer["description"])) for status, answer in answers if status < "400"]
            rows += [(status, "", cell(answer["description"])) for status, answer in answers if status >= "400"]
            lines.append(table(("status", "body", "meaning"), rows))
    for name, lines in groups.items():
        parts += [f"## {NAMES.get(name, name.capitalize())}\n", *lines]
    return "\n".join(part for part in parts if part)


# ---- Configuration and commands ----


def configuration() -> str:
    """The reference of the server's options."""
    parts = [
        "# Configuration\n",
        MADE.format("`server/config.toml`, which is what `troupe-server --print-config` prints"),
    ]
    parts.append(
        "The option `max_batch` is `--max-batch` as a flag, `TROUPE_MAX_BATCH` in the environment and `max_batch` in the file. "
        "[Running a server](../running.md)\n"
        "has them by topic.\n"
    )
    blocks = (ROOT / "server/config.toml").read_text().split("\n\n")
    for block in blocks:
        lines = block.strip().splitlines()
        option = re.fullmatch(r"#?([a-z_0-9]+) =.*", lines[-1]) if lines else None
        if option is None:
            continue
        text = "\n".join(line.removeprefix("#").strip() for line in lines[:-1])
        variable = re.search(r"environment variable `(.+?)`", text)
        default = re.search(r"^Default value: (.+)$", text, re.MULTILINE)
        meaning = text.partition("\nCan also be specified")[0].partition("\nDefault value:")[0].strip()
        named = f"Environment: `{variable[1]}`. " if variable else ""
        usual = f"Default: `{default[1]}`." if default else "No default."
        parts += [f"## {option[1]}\n", meaning.replace("<", "&lt;") + "\n", named + usual + "\n"]
    return "\n".join(parts)


PROGRAMS = {
    "troupe": ROOT / "cli/src/snapshots",
    "troupe-eval": ROOT / "eval/src/snapshots",
    "troupe-server": ROOT / "server/src/snapshots",
    "troupe-loadtest": ROOT / "loadtest/src/cli/snapshots",
}


def commands() -> str:
    """The reference of commands."""
    parts = ["# Commands\n", MADE.format("the snapshots that tests hold to the programs")]
    for program, folder in PROGRAMS.items():
        parts.append(f"## {program}\n")
        helps = {}
        for file in folder.glob("*.snap"):
            name = re.search(r"__help_of_([\w-]+)$", file.stem) or re.search(r".*__(\w+)_help$", file.stem)
            if name:
                words = name[1].replace("_", " ")
                own = words.replace(" ", "-") == program
                helps["" if own else words] = file.read_text().split("---\n", 2)[2]
        for words, text in sorted(helps.items()):
            parts += [f"### {program} {words}".rstrip() + "\n", f"```text\n{tidied(text)}\n```\n"]
    return "\n".join(parts)


def tidied(text: str) -> str:
    """A help without spaces at the ends of lines."""
    return "\n".join(line.rstrip() for line in text.strip().splitlines())


def main(check: bool) -> None:
    """Writes the pages, or compares them."""
    pages = {"grpc.md": messages(), "http.md": http(), "configuration.md": configuration(), "commands.md": commands()}
    stale = []
    for name, text in pages.items():
        page = OUT / name
        text = text.rstrip() + "\n"
        if not check:
            OUT.mkdir(exist_ok=True)
            page.write_text(text)
        elif not page.is_file() or page.read_text() != text:
            stale.append(str(page.relative_to(ROOT)))
    if stale:
        raise SystemExit(f"not current: {', '.join(stale)}; `scripts/docs.sh references` writes them")


if __name__ == "__main__":
    main(sys.argv[1:] == ["--check"])
