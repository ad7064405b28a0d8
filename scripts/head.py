#!/usr/bin/env python3
"""Writes a head on its shoulders as a closed mesh: smooth unions of ellipsoids and capsules, meshed by marching
tetrahedra, which are closed and manifold by construction. The shape is this project's own.

    scripts/head.py [OUTPUT.obj]        (experiments/meshes/head.obj without an argument)

Needs numpy. The same file comes out on every machine: coordinates are rounded to 1e-4 of the head's radius.
"""

import sys

import numpy as np

STEP = 0.085  # edge of a cell of the grid


def ellipsoid(p, centre, radii):
    q = (p - np.array(centre)) / np.array(radii)
    k0 = np.linalg.norm(q, axis=-1)
    k1 = np.linalg.norm(q / np.array(radii), axis=-1)
    return k0 * (k0 - 1.0) / np.maximum(k1, 1e-9)


def capsule(p, a, b, ra, rb=None):
    a, b = np.array(a), np.array(b)
    rb = ra if rb is None else rb
    h = np.clip(((p - a) @ (b - a)) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(p - a - h[..., None] * (b - a), axis=-1) - (ra + h * (rb - ra))


def join(a, b, k):
    h = np.clip(0.5 + 0.5 * (b - a) / k, 0.0, 1.0)
    return b + (a - b) * h - k * h * (1.0 - h)


def cut(a, b, k):
    return -join(-a, b, k)


def head(p):
    """Below 0 inside. Face towards -y, z up."""
    p = p.copy()
    m = p.copy()
    m[..., 0] = np.abs(m[..., 0])  # left and right are alike
    d = ellipsoid(p, (0, 0.14, 0.50), (0.76, 0.92, 0.80))
    d = join(d, ellipsoid(p, (0, -0.22, -0.02), (0.60, 0.60, 0.92)), 0.25)
    d = join(d, ellipsoid(p, (0, -0.50, -0.74), (0.32, 0.28, 0.24)), 0.22)  # chin
    d = join(d, capsule(m, (0.50, 0.02, -0.42), (0.18, -0.48, -0.76), 0.16, 0.13), 0.16)  # jaw
    d = join(d, ellipsoid(m, (0.36, -0.56, -0.10), (0.20, 0.18, 0.16)), 0.18)  # cheek bones
    d = join(d, capsule(m, (0.06, -0.80, 0.32), (0.42, -0.66, 0.34), 0.085), 0.12)  # brows
    d = cut(d, ellipsoid(m, (0.285, -0.94, 0.155), (0.20, 0.24, 0.135)), 0.10)  # sockets
    d = join(d, ellipsoid(m, (0.285, -0.695, 0.145), (0.155, 0.12, 0.10)), 0.03)  # closed eyes
    d = cut(d, capsule(m, (0.16, -0.825, 0.115), (0.41, -0.775, 0.115), 0.018), 0.03)  # lids
    d = join(d, capsule(p, (0, -0.80, 0.26), (0, -1.02, -0.20), 0.075, 0.105), 0.10)  # nose
    d = join(d, ellipsoid(p, (0, -1.05, -0.225), (0.105, 0.11, 0.095)), 0.06)
    d = join(d, ellipsoid(m, (0.115, -0.94, -0.245), (0.075, 0.10, 0.075)), 0.05)
    d = cut(d, ellipsoid(m, (0.06, -1.02, -0.325), (0.035, 0.05, 0.05)), 0.03)
    d = join(d, ellipsoid(p, (0, -0.74, -0.50), (0.28, 0.16, 0.19)), 0.12)  # mouth
    d = join(d, capsule(m, (0.03, -0.905, -0.435), (0.21, -0.80, -0.475), 0.052, 0.03), 0.035)  # upper lip
    d = join(d, capsule(m, (0.0, -0.895, -0.56), (0.19, -0.80, -0.51), 0.062, 0.03), 0.035)  # lower lip
    d = cut(d, capsule(m, (0.0, -0.955, -0.490), (0.23, -0.83, -0.492), 0.022, 0.012), 0.03)
    ear = ellipsoid(m, (0.72, 0.17, 0.08), (0.09, 0.19, 0.27))
    ear = join(ear, ellipsoid(m, (0.655, 0.08, -0.16), (0.09, 0.10, 0.12)), 0.06)
    ear = cut(ear, ellipsoid(m, (0.82, 0.12, 0.10), (0.08, 0.11, 0.17)), 0.05)
    d = join(d, ellipsoid(m, (0.55, 0.16, 0.00), (0.12, 0.16, 0.24)), 0.06)  # where it grows from
    d = join(d, ear, 0.06)
    d = join(d, capsule(p, (0, 0.22, -0.50), (0, 0.30, -1.60), 0.44, 0.42), 0.18)  # neck
    d = join(d, capsule(m, (0.55, -0.05, -0.55), (0.07, -0.22, -1.50), 0.07, 0.07), 0.25)  # muscles of the neck
    d = join(d, ellipsoid(p, (0, 0.26, -2.05), (1.25, 0.62, 0.58)), 0.30)  # shoulders
    return np.maximum(d, -1.98 - p[..., 2])  # flat below


# The six tetrahedra of a cube about its diagonal, by the corners' bits (x, y, z).
TETRAHEDRA = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]


def mesh():
    low, high = np.array([-1.45, -1.40, -2.12]), np.array([1.45, 1.25, 1.50])
    counts = np.ceil((high - low) / STEP).astype(int) + 1
    axes = [low[k] + STEP * np.arange(counts[k]) for k in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    value = np.concatenate([head(slab[None]) for slab in grid])
    # No node lies on the surface.
    value = np.where(np.abs(value) < 1e-6, 1e-6, value)
    inside = value < 0
    strides = np.array([counts[1] * counts[2], counts[2], 1])
    points, flat = grid.reshape(-1, 3), value.ravel()
    corner = np.array([[c & 1, c >> 1 & 1, c >> 2 & 1] for c in range(8)])
    sums = sum(inside[x : counts[0] - 1 + x, y : counts[1] - 1 + y, z : counts[2] - 1 + z].astype(int) for x, y, z in corner)
    vertices, index, faces = [], {}, []

    def vertex(a, b):
        key = (min(a, b), max(a, b))
        if key not in index:
            a, b = key
            t = np.clip(flat[a] / (flat[a] - flat[b]), 0.04, 0.96)
            index[key] = len(vertices)
            vertices.append(points[a] + t * (points[b] - points[a]))
        return index[key]

    for cell in np.argwhere((sums > 0) & (sums < 8)):
        nodes = (cell + corner) @ strides
        for tetrahedron in TETRAHEDRA:
            corners = [nodes[c] for c in tetrahedron]
            within = [n for n in corners if flat[n] < 0]
            without = [n for n in corners if flat[n] > 0]
            if not within or not without:
                continue
            if len(within) == 2:
                (a, b), (c, d) = within, without
                quad = [vertex(a, c), vertex(a, d), vertex(b, d), vertex(b, c)]
                triangles = [(quad[0], quad[1], quad[2]), (quad[0], quad[2], quad[3])]
            else:
                one, others = (within[0], without) if len(within) == 1 else (without[0], within)
                triangles = [tuple(vertex(one, other) for other in others)]
            # Outwards: away from what is inside.
            direction = np.mean([points[n] for n in without], axis=0) - np.mean([points[n] for n in within], axis=0)
            for a, b, c in triangles:
                normal = np.cross(vertices[b] - vertices[a], vertices[c] - vertices[a])
                faces.append((a, b, c) if normal @ direction > 0 else (a, c, b))
    return np.array(vertices), np.array(faces)


def relaxed(vertices, faces, rounds=6):
    """Vertices moved towards their neighbours along the surface, for even triangles."""
    for _ in range(rounds):
        sums, count = np.zeros_like(vertices), np.zeros(len(vertices))
        for k in range(3):
            a, b = faces[:, k], faces[:, (k + 1) % 3]
            np.add.at(sums, a, vertices[b])
            np.add.at(count, a, 1.0)
        vertices = vertices + 0.5 * (sums / count[:, None] - vertices)
        for _ in range(2):  # back onto the surface
            h = 1e-4
            gradient = np.stack([head(vertices + h * e) - head(vertices - h * e) for e in np.eye(3)], axis=-1) / (2 * h)
            square = np.maximum((gradient**2).sum(axis=-1), 0.25)
            vertices = vertices - (head(vertices) / square)[:, None] * gradient
    return vertices


def main():
    path = sys.argv[1] if len(sys.argv) > 1 else "experiments/meshes/head.obj"
    vertices, faces = mesh()
    vertices = relaxed(vertices, faces)
    with open(path, "w", encoding="ascii") as file:
        file.write("# A head, made by scripts/head.py. Licence: MIT or Apache 2.0, as the project.\n")
        for x, y, z in vertices:
            file.write(f"v {x:.4f} {y:.4f} {z:.4f}\n")
        for a, b, c in faces + 1:
            file.write(f"f {a} {b} {c}\n")
    print(f"{path}: {len(vertices)} vertices, {len(faces)} triangles")


if __name__ == "__main__":
    main()
