#!/usr/bin/env python3
"""Puts published tables into the pages that quote them.

    scripts/quote.py [--check]

A page quotes a table by a comment and what follows it up to an empty line:

    <!-- results/published/short/NAME/tables/TABLE.md rows: WORDS; WORDS -->
    | ... |

With `rows:` only those rows are quoted that hold one of the words (between the bars, as they are written there).
Without --check pages are brought up to date; with it, exit code 1 means that one is not. Pictures: `scripts/publish`.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGES = ["README.md", *sorted(str(p.relative_to(ROOT)) for p in (ROOT / "docs").glob("*.md"))]
QUOTE = re.compile(r"<!-- (results/published/\S+\.md)(?: rows: (.*?))? -->\n((?:\|.*\n)*)")


def selected(path, rows):
    """The header of a table, and its rows that hold one of the words."""
    lines = [line for line in (ROOT / path).read_text().splitlines() if line.startswith("|")]
    words = [word.strip() for word in rows.split(";")] if rows else []
    holds = lambda line: not words or any(word in [f.strip() for f in line.split("|")] for word in words)
    return lines[:2] + [line for line in lines[2:] if holds(line)]


def quoted(text):
    def table(match):
        path, rows, _ = match.groups()
        head = match.group(0).split("\n", 1)[0]
        return "\n".join([head, *selected(path, rows)]) + "\n"

    return QUOTE.sub(table, text)


def main():
    check = "--check" in sys.argv[1:]
    stale = []
    for page in PAGES:
        path = ROOT / page
        old = path.read_text()
        new = quoted(old)
        if new != old:
            stale.append(page)
            if not check:
                path.write_text(new)
    for name in stale:
        print(f"{name}: {'not what is published' if check else 'brought up to date'}")
    return 1 if check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
