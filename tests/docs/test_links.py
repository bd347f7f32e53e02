"""Links in the Markdown files are valid: files and headings exist, and addresses are well formed.

Other sites are not visited. Code blocks and code spans are ignored.
"""

import re
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *sorted(ROOT.glob("*.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "results").glob("*.md")),
    *sorted((ROOT / "results" / "reference" / "tables").glob("*.md")),
]
MADE = {ROOT / "docs" / "reference-run.html"}
"""Pages of the site without a file in the repository; ``docs/extensions`` writes them."""

INLINE = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\]\([^)]*\))*\]\(\s*<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\s*\)")
IMAGE = re.compile(r"\[!\[[^\]]*\]\(\s*([^)\s]+)\s*\)\]")
DEFINITION = re.compile(r"^ {0,3}\[[^\]]+\]: *<?(\S+?)>?(?: |$)", re.MULTILINE)
DIRECTIVE = re.compile(r"^`{3,}\{(?:image|figure)\} *(\S+)", re.MULTILINE)
AUTOMATIC = re.compile(r"<(https?://[^>]*)>")
ATTRIBUTE = re.compile(r"\b(?:href|src)=\"([^\"]*)\"")


def prose(text: str) -> str:
    """Return the text without code."""
    text = re.sub(r"^ *(`{3,}).*?^ *\1 *$", "", text, flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"(`+)(?!`).+?(?<!`)\1(?!`)", "code", text)


def targets(text: str) -> list[str]:
    """Return the targets of the links and images of a page."""
    found = DIRECTIVE.findall(text)
    for pattern in (INLINE, IMAGE, DEFINITION, AUTOMATIC, ATTRIBUTE):
        found += pattern.findall(prose(text))
    return found


def anchors(text: str) -> set[str]:
    """Return the names of a page's headings as GitHub and the site make them, and those that are set by hand."""
    without_blocks = re.sub(r"^ *(`{3,}).*?^ *\1 *$", "", text, flags=re.DOTALL | re.MULTILINE)
    names: set[str] = set()
    for heading in re.findall(r"^#{1,6} +(.+?) *#*$", without_blocks, re.MULTILINE):
        shown = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        slug = re.sub(r"[^\w\- ]", "", shown.lower()).replace(" ", "-")
        count = 0
        while (name := f"{slug}-{count}" if count else slug) in names:
            count += 1
        names.add(name)
    return names | set(re.findall(r"\bid=\"([^\"]+)\"", text)) | set(re.findall(r"^\(([\w-]+)\)=$", text, re.MULTILINE))


@cache
def anchors_of(page: Path) -> set[str]:
    return anchors(page.read_text(encoding="utf-8"))


def fault(page: Path, target: str) -> str | None:
    """Return why a link of a page is broken; None if it is valid."""
    parts = urlsplit(target)
    if parts.scheme == "mailto":
        return None if re.fullmatch(r"[^@\s]+@[^@\s]+\.\w+", parts.path) else "is no address of mail"
    if parts.scheme or parts.netloc:
        well_formed = parts.scheme in ("http", "https") and re.fullmatch(r"[\w-]+(\.[\w-]+)+(:\d+)?", parts.netloc)
        return None if well_formed else "is no address of a page"
    if parts.path.startswith("/"):
        return "begins at the root of a disk"
    file = page.parent / unquote(parts.path) if parts.path else page
    if file in MADE:
        return None
    if not file.exists():
        return "leads to no file"
    if parts.fragment and (file.suffix != ".md" or unquote(parts.fragment) not in anchors_of(file)):
        return "leads to no heading"
    return None


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_somewhere(page: Path) -> None:
    faults = {target: fault(page, target) for target in targets(page.read_text(encoding="utf-8"))}
    assert {target: why for target, why in faults.items() if why} == {}


@pytest.mark.parametrize(
    ("link", "why"),
    [
        ("[a](missing.md)", "leads to no file"),
        ('[a](missing.md "title")', "leads to no file"),
        ("![a](missing.png)", "leads to no file"),
        ("[![a](missing.png)](page.md)", "leads to no file"),
        ("[![a](page.md)](missing.md)", "leads to no file"),
        ("[a][b]\n\n[b]: missing.md", "leads to no file"),
        ("```{image} missing.png\n```", "leads to no file"),
        ('<img src="missing.png">', "leads to no file"),
        ("[a](#missing)", "leads to no heading"),
        ("[a](page.md#in-a-block)", "leads to no heading"),
        ("[a](/page.md)", "begins at the root of a disk"),
        ("[a](https://host)", "is no address of a page"),
        ("<http://>", "is no address of a page"),
        ("[a](mailto:nowhere)", "is no address of mail"),
    ],
)
def test_a_dead_link_is_found(link: str, why: str, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"# Page\n\n{link}\n\n```text\n# In a block\n```\n", encoding="utf-8")
    assert why in {fault(page, target) for target in targets(page.read_text(encoding="utf-8"))}


def test_valid_links_to_headings_files_and_sites_are_accepted(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# What `f(x)` is, in 1-D\n\n## Twice\n\n## Twice\n\n[a](#what-fx-is-in-1-d) [b](page.md#twice-1) [c](page.md)"
        " <https://example.org/a?b#c> `[d](missing.md)`\n\n```text\n[e](missing.md)\n```\n",
        encoding="utf-8",
    )
    found = targets(page.read_text(encoding="utf-8"))
    assert len(found) == 4
    assert {fault(page, target) for target in found} == {None}
