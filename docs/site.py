"""Which files of the repository the site has: its pages, and what they link to. MkDocs calls on_files."""

import re
from pathlib import PurePosixPath

FOLDERS = {"docs", "frontend", "backend", "datasets", "pipelines"}
LINK = re.compile(r"\]\(([^)\s#]+)(?:#[^)]*)?\)")


def is_page(path):
    parts = PurePosixPath(path).parts
    return path.endswith(".md") and (len(parts) == 1 or (parts[0] in FOLDERS and "node_modules" not in parts))


def on_files(files, config):
    pages = [file for file in files if is_page(file.src_uri)]
    kept = {file.src_uri for file in pages} | set(config["extra_css"])
    for page in pages:
        with open(page.abs_src_path, encoding="utf-8") as text:
            for target in LINK.findall(text.read()):
                kept.add(normal(page.src_uri, target))
    for file in list(files):
        of_the_theme = not file.abs_src_path.startswith(config["docs_dir"])
        if file.src_uri not in kept and not (of_the_theme and file.src_uri.startswith(("css/", "fonts/", "img/"))):
            files.remove(file)
    add_to_nav(config["nav"], [file.src_uri for file in pages])
    return files


def normal(page, target):
    parts = []
    for part in (PurePosixPath(page).parent / target).parts:
        if part == "..":
            parts[-1:] = []
        else:
            parts.append(part)
    return "/".join(parts)


def add_to_nav(nav, pages):
    """What docs/mkdocs.yml does not name is in the menu all the same."""
    named = set(re.findall(r"[\w./-]+\.md", str(nav)))
    if more := sorted(page for page in pages if page not in named):
        nav.append({"More": more})
