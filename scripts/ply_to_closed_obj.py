#!/usr/bin/env python3
"""Turns a triangle scan (PLY) into a closed, consistently oriented manifold (OBJ).

    scripts/ply_to_closed_obj.py scan.ply body.obj

Python 3.8 or later, standard library only. PLY as text or binary; polygons are cut into fans of triangles.
What it does, in this order, with counts on standard output:

1. takes vertices at one position as one, as the loader does;
2. drops faces that name a vertex twice, and faces that would give an edge a third triangle or a second
   one of the same direction: they leave holes;
3. keeps the largest connected part;
4. where several fans of triangles meet in one vertex, gives each a vertex of its own, moved a hundredth
   of the way to its neighbours so that the copies are separate;
5. closes each hole by triangles from its rim to a new vertex at the mean of the rim;
6. turns the body outside out (positive volume) and centres its bounding box at the origin.

A filled hole is a flat or conical patch: right for the feet of a statue, wrong where a scan misses a
limb. A patch may cut through the body; a run then counts `lost_ray`. Lengths stay as they are;
`longest_side_mm` in an experiment scales them.
"""

import struct
import sys
from collections import defaultdict


TYPES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
         "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f",
         "float64": "d"}


def read_ply(path):
    """Vertices as (x, y, z) and faces as lists of vertex numbers."""
    with open(path, "rb") as file:
        if file.readline().strip() != b"ply":
            sys.exit(f"{path}: not a PLY file")
        elements, order = [], None
        for raw in file:
            words = raw.decode("ascii", "replace").split()
            if not words:
                continue
            if words[0] == "format":
                order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}.get(words[1])
            elif words[0] == "element":
                elements.append((words[1], int(words[2]), []))
            elif words[0] == "property":
                # Name, its type, and for a list that of its length.
                is_list = words[1] == "list"
                elements[-1][2].append((words[-1], words[-2], words[2] if is_list else None))
            elif words[0] == "end_header":
                break
        if order is None:
            sys.exit(f"{path}: a PLY file of no known format")
        properties = {name: {of[0] for of in properties} for name, _, properties in elements}
        if not {"x", "y", "z"} <= properties.get("vertex", set()):
            sys.exit(f"{path}: no vertices with x, y and z")
        if not {"vertex_indices", "vertex_index"} & properties.get("face", set()):
            sys.exit(f"{path}: no faces with vertex_indices: a cloud of points is no surface")

        def number(of):
            form = order + TYPES[of]
            return struct.unpack(form, file.read(struct.calcsize(form)))[0]

        def row(properties):
            words = iter(file.readline().split() if not order else [])
            value = number if order else (lambda of: float(next(words)))
            found = {}
            for name, of, length in properties:
                found[name] = value(of) if length is None else [value(of) for _ in range(int(value(length)))]
            return found

        vertices, faces = [], []
        for name, count, properties in elements:
            for index in range(count):
                try:
                    found = row(properties)
                except (struct.error, StopIteration, ValueError, KeyError):
                    sys.exit(f"{path}: element `{name}`, row {index + 1} of {count}: cut short, or not what the head states")
                if name == "vertex":
                    vertices.append((found["x"], found["y"], found["z"]))
                elif name == "face":
                    corners = found.get("vertex_indices", found.get("vertex_index"))
                    faces.append([int(corner) for corner in corners])
    return vertices, faces


def weld(vertices, faces):
    """Faces that name the first vertex at each position."""
    first = {}
    number = [first.setdefault(vertex, i) for i, vertex in enumerate(vertices)]
    return [[number[i] for i in face] for face in faces]


def sides(triangle):
    a, b, c = triangle
    return (a, b), (b, c), (c, a)


def manifold_triangles(faces):
    """Triangles of the faces of which no two have a directed side in common."""
    used, triangles, dropped = set(), [], 0
    for face in faces:
        for i in range(1, len(face) - 1):
            triangle = (face[0], face[i], face[i + 1])
            if len(set(triangle)) < 3 or any(side in used for side in sides(triangle)):
                dropped += 1
            else:
                used.update(sides(triangle))
                triangles.append(triangle)
    return triangles, dropped


def largest_part(triangles):
    """The triangles of the largest part that is connected across sides."""
    owner = {side: i for i, triangle in enumerate(triangles) for side in sides(triangle)}
    part, best = [None] * len(triangles), []
    for start in range(len(triangles)):
        if part[start] is not None:
            continue
        part[start], members, todo = start, [], [start]
        while todo:
            i = todo.pop()
            members.append(i)
            for a, b in sides(triangles[i]):
                j = owner.get((b, a))
                if j is not None and part[j] is None:
                    part[j] = start
                    todo.append(j)
        if len(members) > len(best):
            best = members
    return [triangles[i] for i in sorted(best)]


def mean(points):
    return tuple(sum(point[k] for point in points) / len(points) for k in range(3))


def toward(point, neighbours):
    return tuple(p + 0.01 * (m - p) for p, m in zip(point, mean(neighbours)))


def split_fans(vertices, triangles):
    """One vertex per fan; vertices that no triangle names are left out."""
    around = defaultdict(dict)  # vertex -> {next vertex on the rim: triangle}
    for i, (a, b, c) in enumerate(triangles):
        for v, left, right in ((a, b, c), (b, c, a), (c, a, b)):
            around[v][left] = (i, right)
    new_vertices, new_triangles = [], [list(triangle) for triangle in triangles]
    for v, fans in around.items():
        left = dict(fans)
        while left:
            ends = {right for _, right in left.values()}
            at = next((n for n in left if n not in ends), next(iter(left)))
            number, fan = len(new_vertices), [at]
            while at in left:
                i, at = left.pop(at)
                fan.append(at)
                new_triangles[i][triangles[i].index(v)] = number
            alone = len(fan) > len(fans)
            new_vertices.append(vertices[v] if alone else toward(vertices[v], [vertices[n] for n in fan]))
    return new_vertices, [tuple(triangle) for triangle in new_triangles]


def close_holes(vertices, triangles):
    """Adds a fan of triangles to every rim; returns the lengths of the rims."""
    directed = {side for triangle in triangles for side in sides(triangle)}
    follow = {b: a for a, b in directed if (b, a) not in directed}  # the missing sides, b to a
    rims = []
    while follow:
        start, after = follow.popitem()
        rim = [start]
        while after != start:
            rim.append(after)
            after = follow.pop(after)
        rims.append(len(rim))
        center = len(vertices)
        vertices.append(mean([vertices[v] for v in rim]))
        triangles.extend((a, b, center) for a, b in zip(rim, rim[1:] + rim[:1]))
    return rims


def volume(vertices, triangles):
    total = 0.0
    for a, b, c in triangles:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = vertices[a], vertices[b], vertices[c]
        total += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    return total / 6.0


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    source, target = sys.argv[1:]
    vertices, faces = read_ply(source)
    triangles, dropped = manifold_triangles(weld(vertices, faces))
    part = largest_part(triangles)
    lost = len(triangles) - len(part)
    vertices, triangles = split_fans(vertices, part)
    rims = close_holes(vertices, triangles)
    if volume(vertices, triangles) < 0.0:
        triangles = [(a, c, b) for a, b, c in triangles]
    middle = [(min(v[k] for v in vertices) + max(v[k] for v in vertices)) / 2 for k in range(3)]
    with open(target, "w", encoding="ascii") as file:
        file.write("# made by scripts/ply_to_closed_obj.py\n")
        for vertex in vertices:
            file.write("v {!r} {!r} {!r}\n".format(*(x - m for x, m in zip(vertex, middle))))
        for triangle in triangles:
            file.write("f {} {} {}\n".format(*(i + 1 for i in triangle)))
    print(f"{target}: {len(vertices)} vertices, {len(triangles)} triangles")
    print(f"  faces dropped: {dropped} not manifold, {lost} outside the largest part")
    largest = ", ".join(str(sides) for sides in sorted(rims, reverse=True)[:8])
    print(f"  holes closed: {len(rims)}" + (f", the largest with rims of {largest} sides" if rims else ""))


if __name__ == "__main__":
    main()
