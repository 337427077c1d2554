"""How long the report of the demonstration is: entries of the menu, and words that are not folded.

python .ci/check_length.py results
"""

import sys
from html.parser import HTMLParser
from pathlib import Path

MAX_ENTRIES = 6
MAX_WORDS = 25_000  # outside of the pages that "Experiments and method" leads to
_SILENT = {"script", "style", "noscript", "template", "option"}
_EMPTY = {"meta", "link", "input", "br", "img", "hr", "circle", "path", "rect"}


class Page(HTMLParser):
    """Words of a page that are visible at first, links of its menu, and all links."""

    def __init__(self) -> None:
        super().__init__()
        self.words = 0
        self.menu: list[str] = []
        self.links: list[str] = []
        self._open: list[tuple[str, bool]] = []  # tag, and whether its texts are hidden

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note an element."""
        if tag in _EMPTY:
            return
        given = dict(attrs)
        hidden = tag in _SILENT or "hidden" in given or (tag == "details" and "open" not in given)
        self._open.append((tag, hidden))
        if tag == "a" and given.get("href"):
            self.links.append(str(given["href"]))
            if any(each == "nav" for each, _ in self._open):
                self.menu.append(str(given["href"]))

    def handle_endtag(self, tag: str) -> None:
        """Leave an element."""
        while self._open and any(each == tag for each, _ in self._open):
            if self._open.pop()[0] == tag:
                break

    def handle_data(self, data: str) -> None:
        """Count words; the summary of what is folded is visible."""
        in_summary = any(tag == "summary" for tag, _ in self._open)
        hiding = [tag for tag, hidden in self._open if hidden]
        if not hiding or (in_summary and hiding == ["details"]):
            self.words += len(data.split())


def read(path: Path) -> Page:
    """Return a page."""
    page = Page()
    page.feed(path.read_text())
    return page


def main() -> int:
    """Print the words of each page; return 1 if there are too many words or entries."""
    report = Path(sys.argv[1]) / "report"
    start = read(report / "index.html")
    behind = set(read(report / "experiments.html").links) - set(start.menu)
    total = 0
    for path in sorted(report.rglob("*.html")):
        name = path.relative_to(report).as_posix()
        words = read(path).words
        counted = name not in behind and name != "experiments.html"
        total += words * counted
        print(f"{words:7}  {name}{'' if counted else '  (experiments and method)'}")
    entries = f"{len(start.menu)} entries, at most {MAX_ENTRIES}"
    print(f"{total:7}  words, at most {MAX_WORDS}; {entries}")
    return int(total > MAX_WORDS or len(start.menu) > MAX_ENTRIES)


if __name__ == "__main__":
    sys.exit(main())
