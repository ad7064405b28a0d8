#!/usr/bin/env python3
"""Renders the cells of experiments/compare/mitsuba-cells.toml with Mitsuba 3, one OpenEXR file per seed.

    python3 -m venv peer && peer/bin/pip install mitsuba numpy
    peer/bin/python scripts/peers/mitsuba/cells.py --list
    peer/bin/python scripts/peers/mitsuba/cells.py --cell forward,smooth,environment --seeds 8 --spp 1024 --out peer

and prints the `scatterproof judge` command for what it wrote.

The scene: the unit sphere about the origin, index 1.3, filled with a homogeneous medium of extinction 10;
an orthographic camera that looks along -z at [-1.1, 1.1]^2, +y up, +x to the right; 32 x 32 pixels, box
filter, emitters hidden. Settings that change the cost and not the mean: Russian roulette is off (--roulette
default restores Mitsuba's), the medium does not sample emitters (inside a closed boundary that always gives
0), and its extinction is declared grey.

One render accumulates in 32-bit floats, so an image is the mean, in 64 bits, of renders of at most 256
samples per pixel. Mitsuba's wheels have no scalar_mono: scalar_rgb renders three equal channels.
"""

import argparse
import math
import os
import sys
import time

import numpy as np

try:
    import mitsuba as mi
except ImportError:
    sys.exit("Mitsuba 3 is not here: pip install mitsuba numpy")

MEDIA = {"isotropic": (0.99, 0.0), "forward": (0.95, 0.8)}
BOUNDARIES = {"ggx-0.2": 0.2, "ggx-0.04": 0.04, "smooth": None}
LIGHTS = ["directional", "disc", "environment"]
CELLS = [f"{m},{b},{l}" for m in MEDIA for b in BOUNDARIES for l in LIGHTS]

SAMPLES_PER_RENDER = 256
DISC_SR = 6.8e-3
DISC_DISTANCE = 1e4


def grey(value):
    return {"type": "rgb", "value": [value] * 3}


def boundary(name, distribution):
    alpha = BOUNDARIES[name]
    if alpha is None:
        return {"type": "dielectric", "int_ior": 1.3, "ext_ior": 1.0}
    return {
        "type": "roughdielectric",
        "distribution": distribution,
        "alpha": alpha,
        "int_ior": 1.3,
        "ext_ior": 1.0,
    }


def light(name):
    """Irradiance 1 across its direction, from (1, 1, 1); or radiance 1 from everywhere."""
    toward = np.ones(3) / math.sqrt(3.0)
    if name == "directional":
        return {"type": "directional", "direction": list(-toward), "irradiance": grey(1.0)}
    if name == "environment":
        return {"type": "constant", "radiance": grey(1.0)}
    # A sphere far away: a disc of directions of 2 pi (1 - cos t), irradiance pi L sin^2 t across it.
    cos_t = 1.0 - DISC_SR / (2.0 * math.pi)
    sin2_t = 1.0 - cos_t * cos_t
    return {
        "type": "sphere",
        "center": list(DISC_DISTANCE * toward),
        "radius": DISC_DISTANCE * math.sqrt(sin2_t),
        "emitter": {"type": "area", "radiance": grey(1.0 / (math.pi * sin2_t))},
    }


def scene(cell, roulette, distribution, body=None):
    """The scene of a cell; `body` is the shape, by default the unit sphere."""
    medium_name, boundary_name, light_name = cell.split(",")
    albedo, g = MEDIA[medium_name]
    phase = {"type": "hg", "g": g} if g else {"type": "isotropic"}
    transform = mi.ScalarTransform4f
    camera = transform().look_at(origin=[0, 0, 3], target=[0, 0, 0], up=[0, 1, 0])
    return mi.load_dict({
        "type": "scene",
        "integrator": {
            "type": "volpath",
            "max_depth": -1,
            "rr_depth": 5 if roulette == "default" else 100_000_000,
            "hide_emitters": True,
        },
        "sensor": {
            "type": "orthographic",
            "to_world": camera @ transform().scale([1.1, 1.1, 1.0]),
            "near_clip": 0.01,
            "far_clip": 10.0,
            "sampler": {"type": "independent", "sample_count": SAMPLES_PER_RENDER},
            "film": {
                "type": "hdrfilm",
                "width": 32,
                "height": 32,
                "pixel_format": "rgb",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
        },
        "light": light(light_name),
        "body": {
            **(body or {"type": "sphere"}),
            "bsdf": boundary(boundary_name, distribution),
            "interior": {
                "type": "homogeneous",
                "sigma_t": 10.0,
                "albedo": grey(albedo),
                "phase": phase,
                "has_spectral_extinction": False,
                "sample_emitters": False,
            },
        },
    })


def render(loaded, spp, seed):
    """The mean of enough renders, and the CPU seconds that they took."""
    begun = time.process_time()
    total, done, part = 0.0, 0, 0
    while done < spp:
        count = min(SAMPLES_PER_RENDER, spp - done)
        image = mi.render(loaded, spp=count, seed=seed * 10_000 + part)
        total = total + count * np.array(image, dtype=np.float64)[:, :, :3]
        done, part = done + count, part + 1
    return total / spp, time.process_time() - begun


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", action="store_true", help="print the cells")
    parser.add_argument("--cell", action="append", help="a cell; without it all of them")
    parser.add_argument("--seeds", type=int, default=8, help="images per cell, at least 2 (default 8)")
    parser.add_argument("--first-seed", type=int, default=0, help="seed of the first image (default 0)")
    parser.add_argument("--spp", type=int, default=256, help="samples per pixel and image (default 256)")
    parser.add_argument("--roulette", choices=["off", "default"], default="off")
    parser.add_argument("--distribution", choices=["ggx", "beckmann"], default="ggx")
    parser.add_argument("--out", default="peer", help="folder for the images (default peer)")
    args = parser.parse_args()
    if args.list:
        print("\n".join(CELLS))
        return
    cells = args.cell or CELLS
    for cell in cells:
        if cell not in CELLS:
            sys.exit(f"no cell `{cell}`; --list names them")
    mi.set_variant("scalar_rgb")
    for cell in cells:
        folder = os.path.join(args.out, cell.replace(",", "-"))
        os.makedirs(folder, exist_ok=True)
        loaded = scene(cell, args.roulette, args.distribution)
        paths, seconds = [], []
        for seed in range(args.first_seed, args.first_seed + args.seeds):
            image, spent = render(loaded, args.spp, seed)
            path = os.path.join(folder, f"seed-{seed}.exr")
            mi.Bitmap(image.astype(np.float32)).write(path)
            paths.append(path)
            seconds.append(spent)
            print(f"{path}: mean {image.mean():.6f}, {spent:.1f} CPU s", file=sys.stderr)
        print(
            f"scatterproof judge --reference results/mitsuba-cells --cell {cell}"
            f" --independent-pixels --seconds {sum(seconds) / len(seconds):.3f} {' '.join(paths)}"
        )


if __name__ == "__main__":
    main()
