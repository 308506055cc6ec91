"""Hooks of mkdocs: what lies outside docs/ gets a page of its own on the site, and links lead there.

README.md and CHANGELOG.md become pages, LICENSE and NOTICE plain text. On the host of the repository, and in
an editor, the links stay what they are: paths of files.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parent.parent
#: File of the repository to its name on the site.
OUTSIDE = {
    "README.md": "readme.md",
    "CHANGELOG.md": "changelog.md",
    "LICENSE": "LICENSE.txt",
    "NOTICE": "NOTICE.txt",
}
_LINK = re.compile(r"(\]\()([^)#\s]+)([^)]*\))")


def on_files(files: Files, config: Any) -> Files:
    """Add the pages and texts from outside docs/, and whatever else of the repository a page links to."""
    for name, where in OUTSIDE.items():
        if (ROOT / name).is_file():
            files.append(File.generated(config, where, content=(ROOT / name).read_text(encoding="utf-8")))
    for file in list(files.documentation_pages()):
        page = file.content_string if file.generated_by else Path(file.abs_src_path).read_text("utf-8")
        for _, target, _ in _LINK.findall(page):
            name = _outside(target, file.src_uri)
            if name and name not in OUTSIDE and files.get_file_from_path(f"repository/{name}") is None:
                source = f"repository/{name}"
                files.append(File.generated(config, source, abs_src_path=str(ROOT / name)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Turn links that leave docs/ into links to the pages made above, and README's links into docs/ back."""
    up = "../" * page.file.src_uri.count("/")

    def mended(link: re.Match[str]) -> str:
        target = link[2]
        if page.file.generated_by and target.startswith("docs/"):
            return f"{link[1]}{target.removeprefix('docs/')}{link[3]}"
        name = _outside(target, page.file.src_uri)
        if name is None:
            return link[0]
        return f"{link[1]}{up}{OUTSIDE.get(name, f'repository/{name}')}{link[3]}"

    return _LINK.sub(mended, markdown)


def _outside(target: str, page: str) -> str | None:
    """The file of the repository outside docs/ that a page's link names, None where it names none."""
    if "://" in target or target.startswith(("mailto:", "/")):
        return None
    source = {where: name for name, where in OUTSIDE.items()}.get(page)
    place = ((ROOT / source if source else ROOT / "docs" / page).parent / target).resolve()
    if not place.is_file() or not place.is_relative_to(ROOT) or place.is_relative_to(ROOT / "docs"):
        return None
    return place.relative_to(ROOT).as_posix()
