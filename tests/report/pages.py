"""Reading pages as strictly as a validator: what is wrong with them, and where they lead."""

import base64
import json
import re
import zlib
from dataclasses import dataclass, field
from functools import cache, cached_property
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, TABLES

VOID = {"meta", "link", "br", "img", "input", "hr", "wbr", "col"}
BLOCKS = {"p", "ul", "ol", "dl", "div", "table", "section", "figure", "header", "footer", "main",
          "nav", "details", "h1", "h2", "h3", "h4", "aside", "form"}  # fmt: skip
INTERACTIVE = {"a", "button", "select", "label", "input", "details"}
ABOVE = {
    "ul ol": ("li",),
    "thead tbody tfoot": ("tr",),
    "tr": ("td", "th"),
    "table": ("caption", "thead", "tbody", "tfoot"),
    "dl": ("dt", "dd"),
    "figure": ("figcaption",),
    "details": ("summary",),
    "select": ("option",),
}
PARENTS = {tag: parents.split() for parents, tags in ABOVE.items() for tag in tags}
NAMING = ("tr", "li", "h1", "summary")
_PACKED = re.compile(r'<script ([^>]*?)class="(\w+)" data-packed>([^<]*)</script>')
_URL = re.compile(r"^(?:[a-z][a-z0-9+.-]*:|//)", re.IGNORECASE)


def unfolded(source: str) -> str:
    """Return a page with what it has packed, as its script unfolds it."""

    def text(found: re.Match[str]) -> str:
        own = zlib.decompress(base64.b64decode(found[3])).decode()
        kept = f'<script {found[1]}class="{found[2]}">{own}</script>'
        return own if found[2] == "later" else kept

    return _PACKED.sub(text, source)


@dataclass
class Element:
    tag: str
    attributes: dict[str, str | None]
    page: str = ""  # the <template> that it stands in
    text: str = ""


@dataclass
class Read(HTMLParser):
    """What a page holds; ``faults`` is empty if its HTML is sound."""

    source: str
    fragment: bool = False
    faults: list[str] = field(default_factory=list)
    elements: list[Element] = field(default_factory=list)
    text: str = ""
    scripts: list[Element] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.source = unfolded(self.source)
        self._open: list[Element] = []
        self._begun = False
        self.feed(self.source)
        self.close()
        self.faults += [f"<{one.tag}> is not closed" for one in self._open]
        if not self.fragment and not self._begun:
            self.faults.append("no doctype")
        for page in {one.page for one in self.elements}:
            own = [one for one in self.elements if one.page == page and one.tag != "template"]
            ids = [one.attributes["id"] or "" for one in own if "id" in one.attributes]
            self.faults += [f"id {one!r} stands twice" for one in set(ids) if ids.count(one) > 1]
            self.faults += [f"id {i!r} is none" for i in ids if not i or re.search(r"\s", i)]
            for one in own:
                for name in ("aria-labelledby", "aria-describedby", "for"):
                    named = (one.attributes.get(name) or "").split()
                    self.faults += [f"{name}={n!r} leads nowhere" for n in named if n not in ids]

    def handle_decl(self, decl: str) -> None:
        self._begun = decl == "DOCTYPE html" and not self.elements

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = [name for name, _ in attrs]
        self.faults += [f"{n} stands twice in <{tag}>" for n in set(names) if names.count(n) > 1]
        self.faults += [f"<{tag}> has {n!r}" for n in names if not re.fullmatch(r"[a-zA-Z-]+", n)]
        above = [one.tag for one in self._open]
        if tag in BLOCKS and "p" in above:
            self.faults.append(f"<{tag}> in <p>")
        if tag in INTERACTIVE and "a" in above:
            self.faults.append(f"<{tag}> in <a>")
        if tag in PARENTS and above[-1:] and above[-1] not in PARENTS[tag]:
            self.faults.append(f"<{tag}> in <{above[-1]}>")
        pages = (one.attributes.get("id") for one in self._open if one.tag == "template")
        element = Element(tag, dict(attrs), next(pages, None) or "")
        self.elements.append(element)
        if tag == "script":
            self.scripts.append(element)
        if tag not in VOID:
            self._open.append(element)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            if not any(one.tag in ("math", "svg") for one in self._open):
                self.faults.append(f"<{tag}/> does not close itself")
            self._open.pop()

    def handle_endtag(self, tag: str) -> None:
        if not self._open or self._open[-1].tag != tag:
            self.faults.append(f"</{tag}> after {[one.tag for one in self._open[-3:]]}")
        else:
            self._open.pop()

    def handle_data(self, data: str) -> None:
        for one in self._open:
            one.text += data
        if not any(one.tag in ("script", "style") for one in self._open):
            self.text += data

    @property
    def ids(self) -> set[str]:
        return {one.attributes["id"] or "" for one in self.elements if "id" in one.attributes}

    @property
    def links(self) -> list[str]:
        names = ("href", "src", "data-plotting", "srcset", "poster", "action", "xlink:href")
        found = (one.attributes.get(name) for one in self.elements for name in names)
        return [link for link in found if link is not None]

    @cached_property
    def data(self) -> dict[str, Any]:
        """What the figures are drawn from."""
        (script,) = (one for one in self.scripts if one.attributes.get("class") == "page")
        found: dict[str, Any] = json.loads(script.text)
        return found

    def naming(self, text: str, *tags: str) -> list[Element]:
        """The innermost lines, titles and rows that say a text."""
        return [one for one in self.elements if one.tag in (tags or NAMING) and text in one.text]

    def external(self) -> list[str]:
        """What would be fetched from elsewhere; names of XML are no addresses."""
        found = [link for link in self.links if _URL.match(link) and not link.startswith("data:")]
        shown = self.source
        for script in sorted(self.scripts, key=lambda one: -len(one.text)):
            shown = shown.replace(script.text, "")
        found += re.findall(r"https?://(?!www\.w3\.org/)[^\s\"'<]*", shown)
        return found + re.findall(r"url\((?!['\"]?data:)[^)]*\)|@import", shown)


@cache
def _read(source: str) -> Read:
    return Read(source)


def read_pages(folder: Path) -> dict[str, Read]:
    """Read all pages below a folder, by their paths."""
    return {
        path.relative_to(folder).as_posix(): _read(path.read_text(encoding="utf-8"))
        for path in sorted(folder.rglob("*.html"))
    }


def lost_links(pages: dict[str, Read], folder: Path, besides: set[str] = frozenset()) -> set[str]:  # type: ignore[assignment]  # an empty default, never written to
    """Return the links that lead to no page, section or file; ``besides`` are made by others."""
    lost = set()
    for path, page in pages.items():
        for link in page.links:
            if link.startswith("data:"):
                continue
            target, _, section = link.partition("#")
            parts = path.split("/")[:-1] if target else path.split("/")
            for part in unquote(target).split("/") if target else []:
                parts = (
                    parts[:-1] if part == ".." and parts and parts[-1] != ".." else [*parts, part]
                )
            found = "/".join(parts)
            if found in pages:
                state = "=" in section  # what is chosen on the page
                if section and not state and unquote(section) not in pages[found].ids:
                    lost.add(f"{path}: {link}")
            elif found not in besides and not (folder / found).is_file():
                lost.add(f"{path}: {link}")
    return lost


def sound_pages(folder: Path, figures: set[str]) -> dict[str, Read]:
    """The pages of a report, without fault, whose links lead to pages, tables and figures."""
    found = read_pages(folder)
    tables = set(TABLES) - set(OF_ONE_RECORDING)
    besides = {f"../tables/{name}.{kind}" for name in tables for kind in ("csv", "parquet")}
    assert {path: page.faults for path, page in found.items() if page.faults} == {}
    assert lost_links(found, folder, besides | figures) == set()
    return found
