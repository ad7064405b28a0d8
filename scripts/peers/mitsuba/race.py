#!/usr/bin/env python3
"""Races scatterproof against Mitsuba 3 on the same work: one core, rounds interleaved, means checked.

    python3 -m venv peer && peer/bin/pip install mitsuba numpy     (and LLVM's library, for Mitsuba's llvm variant)
    cargo build --release
    peer/bin/python scripts/peers/mitsuba/race.py --list
    peer/bin/python scripts/peers/mitsuba/race.py --cell sphere,isotropic,smooth,environment --rounds 5
    peer/bin/python scripts/peers/mitsuba/race.py --markdown race.md          every finite cell

The scene is that of cells.py; a body other than `sphere` is a closed mesh with flat normals: `lumpy-20k`, `lumpy-82k`,
`lumpy-1.3M` are made here, and `--mesh FILE.obj` brings one (scripts/fetch-scans fetches the bunny and the dragon),
scaled to a longest side of 2.

A round renders with Mitsuba, scatterproof, scatterproof, Mitsuba, in CPU seconds of the passes or of `mi.render`, after
a short render of each that compiles kernels and warms caches and is not counted. Mitsuba's figure is the better of its
variants. Speed is camera samples per CPU second. Efficiency is 1 / (variance times CPU seconds), variance being the mean
of the variance of one sample over the pixels that see nothing but the body, they and their neighbours (at its outline a
sample sees the body or not, for every estimator); its error is the jackknife's over images. Where one pixel holds more
than a tenth of the variance the row says "tail", and its efficiency means little. z is the difference of the means of
these pixels over its standard error.
"""

import argparse
import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import time

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import cells as peer  # noqa: E402  (it explains how to install Mitsuba)
from cells import mi  # noqa: E402

PROGRAM = os.path.join(HERE, "..", "..", "..", "target", "release", "scatterproof")
LUMPY = {"lumpy-20k": 5, "lumpy-82k": 6, "lumpy-1.3M": 8}


def estimators(cell):
    """`path` and the most efficient estimator of the cell: name in the table, and in the experiment file."""
    body, medium, boundary, light = cell
    path = ("path", "path = {}")
    if light == "environment":
        return [path, ("guided walks", "path = { walk = { guided = {} } }")]
    # A connection takes little time on the sphere alone, and so does a guided step.
    is_sphere = body == "sphere"
    kind = "snee_connect" if is_sphere and boundary == "smooth" else "snee"
    name, options = f"{kind}, learned calls", "learned_calls = {}"
    if is_sphere and medium == "forward":
        name, options = f"{name}, guided walks", f"{options}, walk = {{ guided = {{ near_lights = true }} }}"
    return [path, (name, f"{kind} = {{ {options} }}")]


def lumpy(level):
    """An icosphere whose radius varies by a quarter: closed, not convex, symmetric in nothing."""
    t = (1 + math.sqrt(5)) / 2
    vertices = [[-1, t, 0], [1, t, 0], [-1, -t, 0], [1, -t, 0], [0, -1, t], [0, 1, t], [0, -1, -t], [0, 1, -t],
                [t, 0, -1], [t, 0, 1], [-t, 0, -1], [-t, 0, 1]]
    faces = [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6],
             [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10],
             [8, 6, 7], [9, 8, 1]]
    v, f = np.array(vertices, dtype=float), np.array(faces)
    for _ in range(level):
        edges = np.sort(np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]]), axis=1)
        unique, index = np.unique(edges, axis=0, return_inverse=True)
        middle = len(v) + index.reshape(3, -1)
        v = np.concatenate([v, 0.5 * (v[unique[:, 0]] + v[unique[:, 1]])])
        a, b, c = f.T
        ab, bc, ca = middle
        f = np.concatenate([np.stack(x, axis=1) for x in [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]])
        v /= np.linalg.norm(v, axis=1, keepdims=True)
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    x, y, z = v.T
    radius = 0.85 + 0.12 * np.sin(3 * x + 1) * np.cos(4 * y) + 0.1 * np.sin(5 * z + 2 * x)
    v *= radius[:, None]
    return v, f


def read_obj(path):
    v, f = [], []
    with open(path) as lines:
        for line in lines:
            words = line.split()
            if words[:1] == ["v"]:
                v.append([float(w) for w in words[1:4]])
            elif words[:1] == ["f"]:
                f.append([int(w.split("/")[0]) - 1 for w in words[1:4]])
    v = np.array(v)
    low, high = v.min(axis=0), v.max(axis=0)
    return (v - 0.5 * (low + high)) * (2.0 / (high - low).max()), np.array(f)


def write_obj(path, v, f):
    with open(path, "w") as out:
        out.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in v.tolist())
        out.writelines(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in f.tolist())


class Peer:
    """Mitsuba, one scene."""

    def __init__(self, variant, cell, obj, roulette):
        mi.set_variant(variant)
        self.variant = variant
        self.scene = peer.scene(cell, roulette, "ggx", None if obj is None else {
            "type": "obj", "filename": obj, "face_normals": True})
        self.seed = 0
        self.images = []

    def covered(self):
        """Pixels that see nothing but the body, they and their neighbours."""
        mi.set_variant(self.variant)
        film = {"type": "hdrfilm", "width": 32, "height": 32, "pixel_format": "rgba", "rfilter": {"type": "box"}}
        transform = mi.ScalarTransform4f
        sensor = mi.load_dict({
            "type": "orthographic",
            "to_world": transform().look_at(origin=[0, 0, 3], target=[0, 0, 0], up=[0, 1, 0]) @ transform().scale([1.1, 1.1, 1.0]),
            "near_clip": 0.01,
            "far_clip": 10.0,
            "sampler": {"type": "independent", "sample_count": 64},
            "film": film,
        })
        image = np.array(mi.render(self.scene, sensor=sensor, integrator=mi.load_dict({"type": "depth"}), spp=64))
        hit = np.pad(image[:, :, -1] > 0.999, 1)
        return np.all([hit[i:i + 32, j:j + 32] for i in range(3) for j in range(3)], axis=0)

    def render(self, samples):
        mi.set_variant(self.variant)
        # Kernels that another scene has pushed out are compiled again before the clock starts.
        peer.render(self.scene, 16, self.seed)
        self.seed += 1
        image, seconds = peer.render(self.scene, samples, self.seed)
        return image[:, :, 0], seconds


def estimate(text, cell, obj, passes, seed, folder):
    """Runs scatterproof; returns mean, variance of one sample per pixel, CPU seconds of the passes."""
    medium, boundary, light = cell
    albedo, g = peer.MEDIA[medium]
    alpha = peer.BOUNDARIES[boundary]
    surface = "smooth = { eta = 1.3 }" if alpha is None else f'rough = {{ distribution = "ggx", alpha = {alpha}, eta = 1.3 }}'
    lights = {
        "directional": "directional = { toward = [1, 1, 1], irradiance = 1 }",
        "disc": f"solid_angle = {{ toward = [1, 1, 1], solid_angle_sr = {peer.DISC_SR}, irradiance = 1 }}",
        "environment": "environment = { radiance = 1 }",
    }
    shape = "sphere = { radius_mm = 1 }" if obj is None else f'mesh = {{ path = "{obj}", normals = "flat" }}'
    path = os.path.join(folder, "race.toml")
    with open(path, "w") as out:
        out.write(f"""name = "race"
seed = {seed}
bands = {{ explicit = [{{ name = "grey" }}] }}
object.shape.{shape}
object.boundary.{surface}
object.medium.coefficients = {{ sigma_t_per_mm = 10, albedo = {albedo}, g = {g} }}
sensor.orthographic = {{ resolution = [32, 32], center_mm = [0, 0, 3], toward = [0, 0, -1], up = [0, 1, 0], width_mm = 2.2 }}
light = [{{ {lights[light]} }}]
estimator = [{{ name = "arm", {text} }}]
budget.passes = {passes}
""")
    results = os.path.join(folder, "results")
    shutil.rmtree(results, ignore_errors=True)
    run = subprocess.run([PROGRAM, "run", path, "--quiet", "--threads", "1", "--out", results], capture_output=True, text=True)
    if run.returncode != 0:
        sys.exit(f"scatterproof: {run.stderr}")
    results = os.path.join(results, "race")
    mean, error = np.load(os.path.join(results, "record/cells/000/000.pixels.npy"))[:, :, :, 0]
    with open(os.path.join(results, "timing.json")) as file:
        timing = json.load(file)["cells"]["base"]["arm"]
    return mean, passes * error**2, timing["cpu_seconds"] + timing["set_up_seconds"]


def jackknife(values, statistic):
    """Standard error of log(statistic) over blocks."""
    n = len(values)
    left_out = [math.log(statistic(values[:i] + values[i + 1:])) for i in range(n)]
    middle = statistics.fmean(left_out)
    return math.sqrt((n - 1) / n * sum((x - middle) ** 2 for x in left_out))


def variance_of(images, samples):
    """Mean over pixels of the variance of one sample, from independent images."""
    return samples * float(np.var(np.stack(images), axis=0, ddof=1).mean())


def error_of_median(times):
    """Of the logarithm, from the median absolute deviation."""
    logs = [math.log(t) for t in times]
    middle = statistics.median(logs)
    spread = 1.4826 * statistics.median(abs(x - middle) for x in logs)
    return 1.2533 * spread / math.sqrt(len(logs))


def most(variances):
    """Share of the pixel that varies most."""
    return variances.max() / variances.sum()


def race(cell, obj, args, folder):
    """One row a pair of estimators."""
    body, medium, boundary, light = cell
    name = ",".join([medium, boundary, light])
    peers = []
    for variant in args.variants:
        rival = Peer(variant, name, obj, args.roulette)
        _, seconds = rival.render(256)
        samples = 256 * max(1, round(args.seconds / max(seconds, 1e-3)))
        peers.append((rival, samples))
    covered = peers[0][0].covered()
    if not covered.any():
        sys.exit(f"{body}: no pixel sees nothing but the body")
    rows = []
    for label, text in estimators(cell):
        _, _, seconds = estimate(text, cell[1:], obj, 64, 1, folder)
        passes = max(64, round(64 * args.seconds / seconds))
        ours, theirs = [], {rival.variant: [] for rival, _ in peers}
        for number in range(args.rounds):
            order = [*peers, None, None, *reversed(peers)]
            for turn, who in enumerate(order):
                if who is None:
                    mean, variance, seconds = estimate(text, cell[1:], obj, passes, 1000 * number + turn + 2, folder)
                    ours.append((mean[covered], variance[covered], seconds))
                else:
                    rival, samples = who
                    image, seconds = rival.render(samples)
                    theirs[rival.variant].append((image[covered], seconds, samples))
        # Medians: Mitsuba compiles a kernel again now and then.
        middle = {v: statistics.median(t for _, t, _ in runs) for v, runs in theirs.items()}
        speeds = {v: runs[0][2] * 1024 / middle[v] for v, runs in theirs.items()}
        better = max(speeds, key=speeds.get)
        images = [image for image, _, _ in theirs[better]]
        samples = theirs[better][0][2]
        own_speed = passes * 1024 / statistics.median(t for *_, t in ours)
        own_variance = statistics.fmean(float(v.mean()) for _, v, _ in ours)
        variance = variance_of(images, samples)
        # Errors of the logarithms: of both variances, and of both medians of times.
        errors = [
            jackknife([float(v.mean()) for _, v, _ in ours], statistics.fmean),
            jackknife(images, lambda kept: variance_of(kept, samples)),
            math.hypot(error_of_median(t for *_, t in ours), error_of_median(t for _, t, _ in theirs[better])),
        ]
        speed = own_speed / speeds[better]
        efficiency = speed * variance / own_variance
        spread = 1.96 * math.hypot(*errors)
        tail = max(most(np.mean([v for _, v, _ in ours], axis=0)), most(np.var(np.stack(images), axis=0)))
        mine = statistics.fmean(float(m.mean()) for m, *_ in ours)
        own_error = math.sqrt(own_variance / (covered.sum() * passes * len(ours)))
        their_means = [float(image.mean()) for image in images]
        z = (mine - statistics.fmean(their_means)) / math.hypot(own_error, statistics.stdev(their_means) / math.sqrt(len(their_means)))
        row = {
            "cell": f"{body}, {medium}, {boundary}, {light}",
            "estimator": label,
            "mitsuba": f"{better.split('_')[0]}, {speeds[better] / 1e3:.0f} k/s",
            "own": f"{own_speed / 1e3:.0f} k/s",
            "speed": f"{speed:.2f} [{math.exp(math.log(speed) - 1.96 * errors[2]):.2f}, {math.exp(math.log(speed) + 1.96 * errors[2]):.2f}]",
            "efficiency": f"{efficiency:.3g} [{efficiency * math.exp(-spread):.3g}, {efficiency * math.exp(spread):.3g}]" + (", tail" if tail > 0.1 else ""),
            "z": f"{z:+.1f}",
        }
        rows.append(row)
        print("  ".join(row.values()), flush=True)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    bodies = ["sphere", *LUMPY]
    # Neither program's path tracing finds parallel light through a smooth boundary.
    known = [f"{b},{c}" for b in bodies for c in peer.CELLS if not c.endswith("smooth,directional")]
    parser.add_argument("--list", action="store_true", help="print the cells")
    parser.add_argument("--cell", action="append", help="a cell; without it all of the sphere and of lumpy-82k")
    parser.add_argument("--mesh", action="append", default=[], help="an OBJ file of a closed mesh, as a body of its name")
    parser.add_argument("--rounds", type=int, default=5, help="rounds per cell, at least 3 (default 5)")
    parser.add_argument("--seconds", type=float, default=1.0, help="CPU seconds of one render (default 1)")
    parser.add_argument("--variants", nargs="+", default=["llvm_ad_mono", "scalar_rgb"])
    parser.add_argument("--roulette", choices=["off", "default"], default="off", help="Mitsuba's own defaults for the lesser row")
    parser.add_argument("--core", type=int, default=0, help="the core that both are pinned to (default 0)")
    parser.add_argument("--out", default="race", help="folder for scratch files (default race)")
    parser.add_argument("--markdown", help="a file for the table")
    args = parser.parse_args()
    for path in args.mesh:
        body = os.path.splitext(os.path.basename(path))[0]
        known += [f"{body},{c}" for c in peer.CELLS]
    if args.list:
        print("\n".join(known))
        return
    if args.rounds < 3:
        sys.exit("an interval needs at least 3 rounds")
    if not os.path.exists(PROGRAM):
        sys.exit("scatterproof is not built: cargo build --release")
    chosen = args.cell or [c for c in known if c.startswith(("sphere,", "lumpy-82k,"))]
    for cell in chosen:
        if cell not in known:
            sys.exit(f"no cell `{cell}`; --list names them")
    os.sched_setaffinity(0, {args.core})
    os.makedirs(args.out, exist_ok=True)
    objs = {"sphere": None}
    begun, rows = time.time(), []
    for cell in chosen:
        parts = tuple(cell.split(","))
        body = parts[0]
        if body not in objs:
            from_file = [p for p in args.mesh if os.path.splitext(os.path.basename(p))[0] == body]
            objs[body] = os.path.abspath(os.path.join(args.out, f"{body}.obj"))
            write_obj(objs[body], *(read_obj(from_file[0]) if from_file else lumpy(LUMPY[body])))
        rows += race(parts, objs[body], args, args.out)
    titles = ["cell", "estimator", "Mitsuba's better variant", "scatterproof", "speed", "efficiency", "z"]
    lines = ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    lines += ["| " + " | ".join(row.values()) + " |" for row in rows]
    foot = f"Mitsuba {mi.__version__}; {args.rounds} rounds of 2 renders of {args.seconds} CPU s; one core; {time.time() - begun:.0f} s in all."
    table = "\n".join([*lines, "", foot, ""])
    if args.markdown:
        with open(args.markdown, "w") as out:
            out.write(table)
    print(table)


if __name__ == "__main__":
    main()
