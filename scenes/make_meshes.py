#!/usr/bin/env python3
"""Writes the meshes of the scenes beside their scene files, always the same bytes.

    python3 scenes/make_meshes.py

Needs only Python's standard library. Lengths are scene units, y points up and
normals point out of the solid.
"""
import math
import pathlib
import struct

HERE = pathlib.Path(__file__).resolve().parent
TAU = 2.0 * math.pi


def add(a, b):
    return tuple(x + y for x, y in zip(a, b))


def scaled(a, s):
    return tuple(x * s for x in a)


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    return scaled(a, 1.0 / math.sqrt(sum(x * x for x in a)))


def closed_grid(nu, nv):
    """Triangles of an nu x nv grid of vertices that wraps round in both directions."""
    faces = []
    for i in range(nu):
        for j in range(nv):
            a, b = i * nv + j, (i + 1) % nu * nv + j
            c, d = (i + 1) % nu * nv + (j + 1) % nv, i * nv + (j + 1) % nv
            faces += [(a, b, c), (a, c, d)]
    return faces


def torus(major, minor, nu, nv):
    """Torus round the y axis."""
    points, normals = [], []
    for i in range(nu):
        u = TAU * i / nu
        for j in range(nv):
            v = TAU * j / nv
            n = (math.cos(v) * math.cos(u), math.sin(v), -math.cos(v) * math.sin(u))
            centre = (major * math.cos(u), 0.0, -major * math.sin(u))
            normals.append(n)
            points.append(add(centre, scaled(n, minor)))
    return points, normals, closed_grid(nu, nv)


def ring(inner, outer, height, bevel, nu, corner):
    """Finger ring round the y axis, standing on y = 0: a rectangle with rounded corners, revolved."""
    corners = [(outer - bevel, bevel, -0.25), (outer - bevel, height - bevel, 0.0),
               (inner + bevel, height - bevel, 0.25), (inner + bevel, bevel, 0.5)]
    profile = []
    for r, y, turn in corners:
        for k in range(corner + 1):
            a = TAU * (turn + 0.25 * k / corner)
            profile.append((r + bevel * math.cos(a), y + bevel * math.sin(a), math.cos(a), math.sin(a)))
    points, normals = [], []
    for i in range(nu):
        c, s = math.cos(TAU * i / nu), -math.sin(TAU * i / nu)
        for r, y, nr, ny in profile:
            points.append((r * c, y, r * s))
            normals.append((nr * c, ny, nr * s))
    return points, normals, closed_grid(nu, len(profile))


def knot(p, q, radius, swing, thick, nu, nv):
    """Tube round a (p, q) torus knot about the y axis."""
    def centre(t):
        r = radius + swing * math.cos(q * t)
        return (r * math.cos(p * t), swing * math.sin(q * t), -r * math.sin(p * t))

    points, normals = [], []
    for i in range(nu):
        t = TAU * i / nu
        here, e = centre(t), 1e-4
        tangent = unit(add(centre(t + e), scaled(centre(t - e), -1.0)))
        # A frame from the torus' own normal stays continuous once round the knot.
        out = (math.cos(q * t) * math.cos(p * t), math.sin(q * t), -math.cos(q * t) * math.sin(p * t))
        side = unit(cross(out, tangent))
        up = cross(tangent, side)
        for j in range(nv):
            a = TAU * j / nv
            n = unit(add(scaled(up, math.cos(a)), scaled(side, math.sin(a))))
            normals.append(n)
            points.append(add(here, scaled(n, thick)))
    return points, normals, closed_grid(nu, nv)


def wave(x, z):
    """Height of the pool's surface over its mean level, and the slopes dy/dx and dy/dz."""
    trains = [(7.3, 3.1, 0.3, 0.036), (-4.1, 8.6, 1.9, 0.030), (9.5, -6.9, 4.0, 0.015), (2.2, 12.1, 2.6, 0.013)]
    y = dx = dz = 0.0
    for kx, kz, phase, height in trains:
        a = kx * x + kz * z + phase
        y += height * math.sin(a)
        dx += height * kx * math.cos(a)
        dz += height * kz * math.cos(a)
    return y, dx, dz


def water(half_x, half_z, bottom, level, n):
    """Closed block of water: smooth waves on top, flat sides and bottom with vertices of their own."""
    points, normals, faces = [], [], []

    def at(i, j):
        x, z = half_x * (2.0 * i / n - 1.0), half_z * (2.0 * j / n - 1.0)
        y, dx, dz = wave(x, z)
        return (x, level + y, z), unit((-dx, 1.0, -dz))

    for i in range(n + 1):
        for j in range(n + 1):
            p, normal = at(i, j)
            points.append(p)
            normals.append(normal)
    for i in range(n):
        for j in range(n):
            a, b = i * (n + 1) + j, (i + 1) * (n + 1) + j
            faces += [(a, a + 1, b + 1), (a, b + 1, b)]
    edges = [([(n, j) for j in range(n + 1)], (1.0, 0.0, 0.0)),
             ([(0, n - j) for j in range(n + 1)], (-1.0, 0.0, 0.0)),
             ([(n - i, n) for i in range(n + 1)], (0.0, 0.0, 1.0)),
             ([(i, 0) for i in range(n + 1)], (0.0, 0.0, -1.0))]
    for line, normal in edges:
        first = len(points)
        for i, j in line:
            top = at(i, j)[0]
            points += [(top[0], bottom, top[2]), top]
            normals += [normal, normal]
        for k in range(first, len(points) - 2, 2):
            faces += [(k, k + 1, k + 3), (k, k + 3, k + 2)]
    first = len(points)
    points += [(-half_x, bottom, -half_z), (half_x, bottom, -half_z), (half_x, bottom, half_z), (-half_x, bottom, half_z)]
    normals += [(0.0, -1.0, 0.0)] * 4
    faces += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return points, normals, faces


def check(points, normals, faces):
    """Every face must turn the way of its vertices' normals."""
    for face in faces:
        a, b, c = (points[k] for k in face)
        turn = cross(add(b, scaled(a, -1.0)), add(c, scaled(a, -1.0)))
        for k in face:
            if sum(x * y for x, y in zip(turn, normals[k])) <= 0.0:
                raise SystemExit(f"face {face} turns against its normals")


def text(v):
    # Adding zero turns -0 into 0, so that the bytes do not depend on its sign.
    return " ".join(f"{round(x, 6) + 0.0:.6f}" for x in v)


def write_obj(name, points, normals, faces):
    lines = ["# written by scenes/make_meshes.py"]
    lines += ["v " + text(p) for p in points]
    lines += ["vn " + text(n) for n in normals]
    lines += ["f " + " ".join(f"{k + 1}//{k + 1}" for k in face) for face in faces]
    (HERE / name).write_bytes(("\n".join(lines) + "\n").encode("ascii"))


def write_ply(name, points, normals, faces, binary):
    form = "binary_little_endian" if binary else "ascii"
    head = ["ply", f"format {form} 1.0", "comment written by scenes/make_meshes.py", f"element vertex {len(points)}"]
    head += [f"property float {p}" for p in ("x", "y", "z", "nx", "ny", "nz")]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    data = ("\n".join(head) + "\n").encode("ascii")
    if binary:
        data += b"".join(struct.pack("<6f", *p, *n) for p, n in zip(points, normals))
        data += b"".join(struct.pack("<B3i", 3, *face) for face in faces)
    else:
        lines = [f"{text(p)} {text(n)}" for p, n in zip(points, normals)]
        lines += ["3 " + " ".join(map(str, face)) for face in faces]
        data += ("\n".join(lines) + "\n").encode("ascii")
    (HERE / name).write_bytes(data)


def main():
    meshes = {
        "torus/torus.obj": torus(0.27, 0.11, 64, 32),
        "ring/ring.ply": ring(0.92, 1.0, 0.42, 0.03, 160, 4),
        "gallery/knot.ply": knot(2, 3, 0.26, 0.11, 0.05, 192, 12),
        "gallery/hoop.ply": torus(0.3, 0.05, 48, 16),
        "pool/water.obj": water(1.05, 1.45, -0.05, 0.6, 50),
    }
    for name, mesh in meshes.items():
        check(*mesh)
        if name.endswith(".obj"):
            write_obj(name, *mesh)
        else:
            write_ply(name, *mesh, binary=name != "gallery/hoop.ply")
        print(f"{name}: {len(mesh[0])} vertices, {len(mesh[2])} triangles")


if __name__ == "__main__":
    main()
