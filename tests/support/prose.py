"""Sentences of comments, docstrings and pages, and their counts, which CONTRIBUTING.md bounds.

`python tests/support/prose.py FOLDER_OR_FILE...` prints the counts of each and the sentences to rewrite.
"""

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

MIN_WORDS = 4  # shorter pieces are labels
OPENERS = ("what", "where", "of", "those")
WORD = re.compile(r"[A-Za-z][A-Za-z'’-]*")
CODE_SPAN = re.compile(r"``[^`]*``|`[^`]*`")
SENTENCE_END = re.compile(r"(?<=[.!?])\s+(?=[`\"'(]*[A-Za-z])")
ITEM_END = re.compile(r"(?<=[.!?])[*]*\s+(?=[`\"'(*\[]*[A-Z0-9])")
FIELD = re.compile(r"^\s*[*]{0,2}[\w., *`=\[\]|]+(\(.*?\))?: ")  # "q: configuration (nq,)" of a docstring
ARGUMENT = re.compile(r"^\w+: \w+ must ")  # "plot: what must be ..." of a message names an argument
C_STRING = r'"(?:[^"\\\n]|\\.)*"'
C_STRINGS = re.compile(rf"{C_STRING}(?:\s*{C_STRING})*")
JS_STRING = re.compile(r"\"(?:[^\"\\\n]|\\.)*\"|'(?:[^'\\\n]|\\.)*'|`(?:[^`\\]|\\.)*`")
C_COMMENT = re.compile(r"(?:^|(?<=[\s;{}(),]))//[^\n]*|/\*.*?\*/", re.DOTALL)
SUFFIXES = {".py", ".pyi", ".hpp", ".cpp", ".js", ".css", ".html", ".md"}


@dataclass(frozen=True)
class Sentence:
    """Sentence with the first line of its paragraph."""

    path: Path
    line: int
    text: str

    @cached_property
    def words(self) -> list[str]:
        """Return the words of the sentence in lower case, without spans of code."""
        return [word.lower() for word in WORD.findall(CODE_SPAN.sub(" ", self.text))]

    @property
    def has_what(self) -> bool:
        """Check if the sentence has the word `what`, and is no question."""
        return "what" in self.words and not self.text.endswith("?")

    @property
    def has_opener(self) -> bool:
        """Check if the sentence opens with a word that stands for a noun."""
        first = self.text.lstrip("`\"'(*_ ").split(" ", 1)[0].lower()
        return first in OPENERS and not self.text.endswith("?")


@dataclass(frozen=True)
class Counts:
    """Numbers of sentences: in total, with `what`, and with an opener that stands for a noun."""

    sentences: int
    whats: int
    openers: int

    @property
    def whats_per_100(self) -> float:
        """Return the number of sentences with `what` per 100."""
        return 100 * self.whats / max(self.sentences, 1)

    @property
    def openers_percent(self) -> float:
        """Return the percentage of sentences with an opener that stands for a noun."""
        return 100 * self.openers / max(self.sentences, 1)


def sentences_of(path: Path) -> list[Sentence]:
    """Return the sentences of the comments, docstrings and literals of a source, or of the text of a page."""
    text = path.read_text()
    if path.suffix in {".py", ".pyi"}:
        blocks = [*_docstrings(text), *_python_comments(text), *_python_literals(text)]
    elif path.suffix == ".md":
        blocks = list(_paragraphs(text))
    elif path.suffix == ".html":
        blocks = list(_html_texts(text))
    else:
        blocks = [*_c_comments(text), *_c_literals(text, path.suffix)]
    return _long_sentences(path, blocks)


def literal_sentences_of(path: Path) -> list[Sentence]:
    """Return the sentences of the string literals of a source: messages, help texts, texts of replays."""
    text = path.read_text()
    if path.suffix in {".py", ".pyi"}:
        return _long_sentences(path, list(_python_literals(text)))
    return _long_sentences(path, list(_c_literals(text, path.suffix)))


def bullets_of(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the line and the sentences of each item of the lists of a Markdown page."""
    items: list[tuple[int, list[str]]] = []
    is_item = False
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if line.startswith("- "):
            items.append((number, []))
        is_item = line.startswith("- ") or (is_item and line.startswith("  "))
        if is_item:
            items[-1][1].append(line.strip().removeprefix("- "))
    for number, lines in items:
        yield number, ITEM_END.split(" ".join(lines))


def _long_sentences(path: Path, blocks: list[tuple[int, str]]) -> list[Sentence]:
    found = [
        Sentence(path, line, piece)
        for line, block in blocks
        for piece in SENTENCE_END.split(" ".join(block.split()))
    ]
    return [sentence for sentence in found if len(sentence.words) >= MIN_WORDS]


def count(sentences: list[Sentence]) -> Counts:
    """Return the counts of a list of sentences."""
    return Counts(len(sentences), sum(s.has_what for s in sentences), sum(s.has_opener for s in sentences))


def sources_below(root: Path) -> list[Path]:
    """Return the files with comments or text below a folder, or the file itself."""
    if root.is_file():
        return [root]
    return sorted(
        path
        for path in root.rglob("*")
        if path.suffix in SUFFIXES and "vendor" not in path.parts and not path.name.endswith(".min.js")
    )


@lru_cache(maxsize=1)
def _nodes(text: str) -> list[ast.AST]:
    return list(ast.walk(ast.parse(text)))


def _docstrings(text: str) -> Iterator[tuple[int, str]]:
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for node in _nodes(text):
        if isinstance(node, documented) and (string := ast.get_docstring(node)):
            first = node.body[0].lineno
            for offset, block in _blocks(string.splitlines()):
                yield first + offset, block


def _python_literals(text: str) -> Iterator[tuple[int, str]]:
    """Yield paragraphs of the string literals that are no docstrings, with code spans for fields."""
    nodes = _nodes(text)
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    read = {id(node.body[0].value) for node in nodes
            if isinstance(node, documented) and ast.get_docstring(node) is not None}  # fmt: skip
    for node in nodes:
        if isinstance(node, ast.JoinedStr):
            read |= {id(part) for part in node.values}
            string = "".join(str(p.value) if isinstance(p, ast.Constant) else "`x`" for p in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in read:
            string = node.value
        else:
            continue
        for block in re.split(r"\n\s*\n", string):
            yield node.lineno, ARGUMENT.sub("", " ".join(block.split()))


def _c_literals(text: str, suffix: str) -> Iterator[tuple[int, str]]:
    code = C_COMMENT.sub(lambda comment: "\n" * comment.group().count("\n"), text)
    for match in (JS_STRING if suffix == ".js" else C_STRINGS).finditer(code):
        string = match.group() if suffix == ".js" else "".join(re.findall(rf"{C_STRING}", match.group()))
        yield (
            code.count("\n", 0, match.start()) + 1,
            re.sub(r"\$\{[^}]*\}", "`x`", string.replace('"', "")).strip("'`"),
        )


def _python_comments(text: str) -> Iterator[tuple[int, str]]:
    lines: dict[int, str] = {}
    alone = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            lines[token.start[0]] = token.string.lstrip("#!: ")
            if not token.line[: token.start[1]].strip():
                alone.add(token.start[0])
    yield from _joined(lines, alone)


def _c_comments(text: str) -> Iterator[tuple[int, str]]:
    lines: dict[int, str] = {}
    alone = set()
    for number, line in enumerate(text.splitlines(), 1):
        match = re.search(r"(?:^|[\s;{}(),])//+[/<!]*\s?(.*)$", line)
        if match and not re.search(r"https?:$", line[: match.start() + 7]):
            lines[number] = match.group(1)
            if not line[: match.start()].strip():
                alone.add(number)
    yield from _joined(lines, alone)
    for match in re.finditer(r"/\*(.*?)\*/", text, re.DOTALL):
        first = text.count("\n", 0, match.start()) + 1
        block = [re.sub(r"^\s*\*+", "", line) for line in match.group(1).splitlines()]
        for offset, piece in _blocks(block):
            yield first + offset, piece


def _html_texts(text: str) -> Iterator[tuple[int, str]]:
    """Yield the texts and titles between the tags of a page."""
    for match in re.finditer(r'>([^<>]+)<|(?:title|aria-label)="([^"]*)"', text):
        yield text.count("\n", 0, match.start()) + 1, match.group(1) or match.group(2)


def _joined(lines: dict[int, str], alone: set[int]) -> Iterator[tuple[int, str]]:
    """Yield joined comments of consecutive lines; each line after the first has no code."""
    block: list[str] = []
    start = previous = -1
    for number, line in sorted(lines.items()):
        if not (block and number == previous + 1 and number in alone and line.strip()):
            if block:
                yield start, " ".join(block)
            block, start = [], number
        block.append(line)
        previous = number
    if block:
        yield start, " ".join(block)


def _blocks(lines: list[str]) -> Iterator[tuple[int, str]]:
    """Yield paragraphs of a docstring; each argument is a separate paragraph."""
    block: list[str] = []
    start = 0
    for number, line in enumerate(lines):
        if block and (not line.strip() or FIELD.match(line) or line.lstrip().startswith(("- ", "* "))):
            yield start, " ".join(block)
            block = []
        if line.strip():
            if not block:
                start = number
                line = FIELD.sub("", line, count=1) or line
            block.append(line.strip().lstrip("-* "))
    if block:
        yield start, " ".join(block)


def _paragraphs(text: str) -> Iterator[tuple[int, str]]:
    """Yield paragraphs, items and cells of a Markdown page, without code, formulas and comments."""
    fenced = False
    block: list[str] = []
    start = 0
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith(("```", "$$")):
            fenced = not fenced
        starts = (
            fenced or not line.strip() or line.lstrip().startswith(("- ", "* ", "#", "|", "<", "```", "$$"))
        )
        if starts and block:
            yield start, " ".join(block)
            block = []
        if fenced or line.lstrip().startswith(("```", "$$", "<")):
            continue
        if line.lstrip().startswith("|"):
            for cell in line.strip().strip("|").split("|"):
                yield number, cell
        elif line.strip():
            start = start if block else number
            block.append(line.strip().lstrip("-*# "))
    if block:
        yield start, " ".join(block)


def main(arguments: list[str]) -> None:
    """Print the counts of each folder or file, and the sentences that violate the style."""
    for argument in arguments:
        found = [s for path in sources_below(Path(argument)) for s in sentences_of(path)]
        counts = count(found)
        print(
            f"{argument}: {counts.sentences} sentences, {counts.whats_per_100:.1f} what per 100,"
            f" {counts.openers_percent:.1f} % openers"
        )
        for sentence in found:
            if sentence.has_what or sentence.has_opener:
                print(f"  {sentence.path}:{sentence.line}: {sentence.text}")


if __name__ == "__main__":
    main(sys.argv[1:])
