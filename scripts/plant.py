#!/usr/bin/env python3
"""Plants known defects in a copy of the source, one at a time, and asks whether the claims find them.

    scripts/plant.py [--only TEXT...] [--out DIR]

The defects are those of tests/planted.toml. For each, the copy is built and played: `scatterproof verify` on the named
files at the ci setting, or the named unit tests, must fail. Before that, the sound source must pass all of them. Writes
DIR/shipped.csv and DIR/shipped.md (default: results/published), a row for each defect. About three minutes for each
defect on two cores. Python 3.11 or later, standard library only.

Exit code: 0 every defect is found and the sound source is green, 1 not so, 2 bad usage or a defect that does not apply.
"""
import argparse
import csv
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIST = ROOT / "tests" / "planted.toml"


def refuse(sentence):
    print(f"plant.py: {sentence}", file=sys.stderr)
    sys.exit(2)


def copy_source(to):
    """Tracked files as they are in the working tree."""
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True).stdout
    for name in filter(None, names.decode().split("\0")):
        if (ROOT / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            (to / name).write_bytes((ROOT / name).read_bytes())


class Copy:
    """The copy of the source, its build and its runs."""

    def __init__(self, folder):
        self.source, self.runs = folder / "source", folder / "runs"
        copy_source(self.source)
        # One changed line is compiled in a quarter of the time; no floating-point result depends on either.
        self.environment = {
            **os.environ,
            "CARGO_TARGET_DIR": str(folder / "target"),
            "CARGO_INCREMENTAL": "1",
            "CARGO_PROFILE_RELEASE_CODEGEN_UNITS": "256",
        }

    def cargo(self, *words):
        return subprocess.run(["cargo", *words], cwd=self.source, env=self.environment, capture_output=True, text=True)

    def build(self):
        done = self.cargo("build", "--release", "--locked", "--quiet")
        if done.returncode != 0:
            refuse(f"the source does not compile:\n{done.stderr}")

    def verify(self, name, run):
        """Whether the claims of a file fail, and how many."""
        out = self.runs / run / name
        table = out.with_suffix(".csv")
        out.parent.mkdir(parents=True, exist_ok=True)
        program = Path(self.environment["CARGO_TARGET_DIR"]) / "release" / "scatterproof"
        words = ["verify", f"experiments/verify/{name}.toml", "--setting", "ci", "--quiet", "--no-report"]
        words += ["--out", str(out), "--csv", str(table)]
        done = subprocess.run([program, *words], cwd=self.source, capture_output=True, text=True)
        if done.returncode not in (0, 1, 3):
            refuse(f"`verify` of {name} ended with {done.returncode}:\n{done.stderr}")
        with open(table, newline="") as file:
            outcomes = [row["outcome"] for row in csv.DictReader(file)]
        failed = sum(outcome == "fail" for outcome in outcomes)
        return done.returncode == 1, f"{name}: {failed} of {len(outcomes)} verdicts fail"

    def test(self, name, _run):
        done = self.cargo("test", "--release", "--locked", "--quiet", "--lib", name)
        if "0 passed; 0 failed" in done.stdout:
            refuse(f"there is no unit test `{name}`")
        is_found = "test result: FAILED" in done.stdout
        if done.returncode != 0 and not is_found:
            refuse(f"unit test `{name}` did not run:\n{done.stderr}")
        return is_found, f"unit test {name}: {'fails' if is_found else 'passes'}"

    def look(self, defect, run):
        """All that the defect names: (found, what was seen) for each."""
        return [self.verify(name, run) for name in defect.get("verify", [])] + [
            self.test(name, run) for name in defect.get("tests", [])
        ]


def planted(defect, source):
    """The text of the file with the defect, and without."""
    sound = (source / defect["file"]).read_text()
    count = sound.count(defect["find"])
    if count != 1:
        refuse(f"{defect['name']}: its text is {count} times in {defect['file']}, not once")
    return sound.replace(defect["find"], defect["replace"]), sound


def write(out, rows):
    out.mkdir(parents=True, exist_ok=True)
    with open(out / "shipped.csv", "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["defect", "what", "file", "found", "seen"])
        table.writerows(rows)
    lines = [
        "# Defects in the shipped source",
        "",
        "Made by `scripts/plant.py`; do not edit. Each defect was planted in a copy of the source, and the claims named",
        "were played at the setting of continuous integration. The sound source passes all of them.",
        "",
        "| defect | what is wrong | found | seen |",
        "|---|---|---|---|",
    ]
    lines += [f"| {name} | {what} | {found} | {seen} |" for name, what, _, found, seen in rows]
    (out / "shipped.md").write_text("\n".join(lines) + "\n")


def main():
    parser = argparse.ArgumentParser(description="Plants known defects in a copy of the source.")
    parser.add_argument("--only", nargs="+", default=[""], metavar="TEXT", help="defects whose names contain a TEXT")
    parser.add_argument("--out", type=Path, metavar="DIR", help="where the tables go; default results/published")
    asked = parser.parse_args()
    if any(asked.only) and not asked.out:
        refuse("a part of the list is not published: --out DIR")
    defects = [d for d in tomllib.loads(LIST.read_text())["defect"]
               if any(text in d["name"] for text in asked.only)]
    if not defects:
        refuse(f"no defect of {LIST.name} has `{'`, `'.join(asked.only)}` in its name")
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(Path(folder))
        texts = [planted(defect, copy.source) for defect in defects]
        copy.build()
        every = {kind: sorted({n for d in defects for n in d.get(kind, [])}) for kind in ("verify", "tests")}
        false_alarms = [seen for found, seen in copy.look(every, "sound") if found]
        for seen in false_alarms:
            print(f"the sound source: {seen}")
        rows = []
        for defect, (wrong, sound) in zip(defects, texts):
            start = time.monotonic()
            path = copy.source / defect["file"]
            path.write_text(wrong)
            if "verify" in defect:
                copy.build()
            looks = copy.look(defect, defect["name"])
            path.write_text(sound)
            found = "yes" if all(found for found, _ in looks) else "NO"
            seen = "; ".join(seen for _, seen in looks)
            print(f"{defect['name']:28} found {found:3} {seen} ({time.monotonic() - start:.0f} s)", flush=True)
            rows.append([defect["name"], defect["what"], defect["file"], found, seen])
    write(asked.out or ROOT / "results" / "published", rows)
    return 1 if false_alarms or any(row[3] != "yes" for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
