#!/usr/bin/env python3
"""Says which arrays of two results differ, from their manifests alone.

    scripts/compare_manifests.py OLD/manifest.json NEW/manifest.json

Python 3.8 or later, standard library only. Exit code: 0 every array is byte-identical, 1 one is not, 2 a manifest is missing.
"""
import json
import sys
from pathlib import Path


def runs(manifest):
    return {(run["cell"], run["label"], run["estimator"]): run for run in manifest["runs"]}


def main():
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    for path in sys.argv[1:]:
        if not Path(path).is_file():
            print(f"compare_manifests.py: no file {path}", file=sys.stderr)
            return 2
    old, new = (json.loads(Path(path).read_text()) for path in sys.argv[1:])
    told = []
    for key, name in [("experiment_hash", "the resolved experiment"), ("fingerprint", "what fixes the bits")]:
        if old[key] != new[key]:
            print(f"  {name} differs: {old[key]} -> {new[key]}")
    before, after = runs(old), runs(new)
    for key in sorted(before.keys() | after.keys()):
        cell, label, estimator = key
        place = f"  cell {cell:03} {label or 'base'}, {estimator}"
        if key not in after or key not in before:
            told.append(f"{place}: only in the {'new' if key in after else 'old'} one")
            continue
        a, b = before[key], after[key]
        if a["passes"] != b["passes"]:
            told.append(f"{place}: {a['passes']} -> {b['passes']} passes")
        names = sorted(a["arrays"].keys() | b["arrays"].keys())
        differing = [name for name in names if a["arrays"].get(name) != b["arrays"].get(name)]
        if differing:
            told.append(f"{place}: {', '.join(differing)}")
    arrays = sum(len(run["arrays"]) for run in after.values())
    if told:
        print("\n".join(["  not byte-identical:", *told]))
        return 1
    print(f"  {arrays} arrays of {len(after)} runs are byte-identical")
    return 0


if __name__ == "__main__":
    sys.exit(main())
