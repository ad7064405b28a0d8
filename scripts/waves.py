#!/usr/bin/env python3
"""Writes a block of water under waves as a closed mesh: a wavy top over flat walls and a flat bottom. The shape is this
project's own.

    scripts/waves.py [OUTPUT.obj]        (experiments/meshes/waves.obj without an argument)

The same file comes out on every machine: coordinates are rounded to 1e-4 mm.
"""

import math
import sys

SIZE = (40.0, 6.0, 28.0)  # mm
CELLS = (160, 24)
# Amplitude in mm, wave vector in 1/mm, phase. Crests focus light about 10 mm below the surface.
WAVES = [
    (0.22, (1.15, 0.35), 0.3),
    (0.16, (-0.80, 0.90), 1.9),
    (0.09, (1.70, -0.60), 4.1),
    (0.05, (0.60, 1.90), 2.6),
    (0.03, (2.50, 0.80), 5.2),
]


def height(x, y):
    return sum(a * math.sin(k * x + l * y + p) for a, (k, l), p in WAVES)


def mesh():
    (nx, ny), (sx, sy, sz) = CELLS, SIZE
    vertices, faces = [], []
    top = {}
    for i in range(nx + 1):
        for j in range(ny + 1):
            x, y = sx * (i / nx - 0.5), sy * (j / ny - 0.5)
            top[i, j] = len(vertices)
            vertices.append((x, y, sz / 2 + height(x, y)))
    for i in range(nx):
        for j in range(ny):
            a, b, c, d = top[i, j], top[i + 1, j], top[i + 1, j + 1], top[i, j + 1]
            faces += [(a, b, c), (a, c, d)]
    # Round the edge, seen from above counter-clockwise.
    rim = [(i, 0) for i in range(nx)] + [(nx, j) for j in range(ny)]
    rim += [(i, ny) for i in range(nx, 0, -1)] + [(0, j) for j in range(ny, 0, -1)]
    bottom = []
    for node in rim:
        bottom.append(len(vertices))
        x, y, _ = vertices[top[node]]
        vertices.append((x, y, -sz / 2))
    for k in range(len(rim)):
        n = (k + 1) % len(rim)
        a, b, c, d = bottom[k], bottom[n], top[rim[n]], top[rim[k]]
        faces += [(a, b, c), (a, c, d)]
    centre = len(vertices)
    vertices.append((0.0, 0.0, -sz / 2))
    faces += [(centre, bottom[(k + 1) % len(rim)], bottom[k]) for k in range(len(rim))]
    return vertices, faces


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else "experiments/meshes/waves.obj"
    vertices, faces = mesh()
    with open(path, "w", encoding="ascii") as file:
        file.write("# Water under waves, made by scripts/waves.py. Licence: MIT or Apache 2.0, as the project.\n")
        for x, y, z in vertices:
            file.write(f"v {x:.4f} {y:.4f} {z:.4f}\n")
        for a, b, c in faces:
            file.write(f"f {a + 1} {b + 1} {c + 1}\n")
    print(f"{path}: {len(vertices)} vertices, {len(faces)} triangles")


if __name__ == "__main__":
    main()
