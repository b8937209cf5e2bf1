#!/usr/bin/env python3
"""Writes the meshes and expected.json: what Mitsuba 3 sees of shapes.xml, camera.xml and some emitters.

    pip install mitsuba==3.9.1 numpy && python3 tests/load_reference/make.py
"""
import json
import math
import pathlib
import random

import mitsuba as mi

mi.set_variant("scalar_rgb")
HERE = pathlib.Path(__file__).resolve().parent
numbers = lambda v: [round(float(x), 7) for x in v]

# An octahedron with edges of three lengths; the normals of the smooth ones are not those of its faces.
POINTS = [(1, 0, 0), (-1, 0, 0), (0, 1.2, 0), (0, -1.2, 0), (0, 0, 1.5), (0, 0, -1.5)]
FACES = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
unit = lambda v: tuple(x / math.sqrt(sum(y * y for y in v)) for x in v)
NORMALS = [unit((x + 0.1, y - 0.05, z + 0.07)) for x, y, z in POINTS]


def meshes():
    line = lambda tag, v: tag + " " + " ".join(f"{x:.7g}" for x in v) + "\n"
    points = "".join(line("v", p) for p in POINTS)
    bare = points + "".join(line("f", [k + 1 for k in f]) for f in FACES)
    faces = "".join("f " + " ".join(f"{k + 1}//{k + 1}" for k in f) + "\n" for f in FACES)
    (HERE / "bare.obj").write_text(bare)
    (HERE / "smooth.obj").write_text(points + "".join(line("vn", n) for n in NORMALS) + faces)
    for name, normals in [("bare.ply", None), ("smooth.ply", NORMALS)]:
        properties = ["x", "y", "z"] + (["nx", "ny", "nz"] if normals else [])
        head = ["ply", "format ascii 1.0", "element vertex 6", *(f"property float {p}" for p in properties),
                "element face 8", "property list uchar int vertex_indices", "end_header"]
        rows = [p + normals[i] if normals else p for i, p in enumerate(POINTS)]
        rows += [(3, *f) for f in FACES]
        (HERE / name).write_text("\n".join(head) + "\n" + "".join(line("", r)[1:] for r in rows))


def shapes():
    scene = mi.load_file(str(HERE / "shapes.xml"))
    rng = random.Random(1)
    hits = []
    for index in range(len(scene.shapes())):
        for _ in range(12):
            target = [10 * index + rng.uniform(-0.7, 0.7), rng.uniform(-0.7, 0.7), rng.uniform(-0.7, 0.7)]
            direction = unit([rng.gauss(0, 1) for _ in range(3)])
            origin = [t - 4 * d for t, d in zip(target, direction)]
            si = scene.ray_intersect(mi.Ray3f(origin, direction))
            hit = {"origin": numbers(origin), "direction": numbers(direction)}
            if si.is_valid():
                hit |= {"position": numbers(si.p), "normal": numbers(si.sh_frame.n)}
            hits.append(hit)
    return hits


def cameras():
    cases = [{"fov_axis": axis, "width": w, "height": h}
             for axis in ("x", "y", "diagonal", "smaller", "larger") for w, h in ((64, 32), (30, 50))]
    cases += [{"mirror": -1}, {"sensor": "thinlens", "mirror": -1}]
    results = []
    for case in cases:
        case = {name: str(value) for name, value in case.items()}
        text = (HERE / "camera.xml").read_text()
        if case.get("sensor") == "thinlens":
            lens = '<float name="aperture_radius" value="0.2"/></sensor>'
            text = text.replace("</sensor>", lens)
        scene = mi.load_string(text, **case)
        size = scene.sensors()[0].film().size()
        rays = []
        for at in ((0.5, 0.5), (0.1, 0.2), (0.9, 0.3), (0.25, 0.95)):
            # The middle of the lens: rays of all other points of the lens meet this one in the plane of focus.
            ray, _ = scene.sensors()[0].sample_ray(0, 0, at, (0.5, 0.5))
            rays.append({"film": [at[0] * size[0], at[1] * size[1]], "origin": numbers(ray.o), "direction": numbers(ray.d)})
        results.append({"overrides": case, "rays": rays})
    return results


def emitters():
    results = []
    for value in ('<rgb name="radiance" value="1, 2, 3"/>', '<spectrum name="radiance" value="2"/>',
                  '<float name="radiance" value="2"/>', ""):
        scene = mi.load_string(f'<scene version="3.0.0"><emitter type="constant">{value}</emitter></scene>')
        si = scene.ray_intersect(mi.Ray3f([0, 0, 0], [0, 0, 1]))
        results.append({"value": value, "radiance": numbers(scene.environment().eval(si))})
    return results


def main():
    meshes()
    expected = {"mitsuba": mi.__version__, "shapes": shapes(), "cameras": cameras(), "emitters": emitters()}
    lines = json.dumps(expected, indent=None).replace("}, {", "},\n{")
    (HERE / "expected.json").write_text(lines + "\n")


if __name__ == "__main__":
    main()
