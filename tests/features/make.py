#!/usr/bin/env python3
"""Writes the small scenes that show one feature each, and renders their references with Mitsuba 3.

    pip install mitsuba==3.9.1 numpy pillow
    python3 tests/features/make.py [NAME ...] [--spp 4096]

Each scene becomes NAME.xml with the files that it needs; its reference NAME.exr (mean, half float) and NAME_var.exr
(variance of the mean, single float), 32x32, in 16 batches. Scenes are written for Mitsuba 3 alone, so that it and
pathblend read the same bytes.
"""
import argparse
import os
import pathlib
import struct
import tempfile
import zlib

HERE = pathlib.Path(__file__).resolve().parent
SIDE, BATCHES, DEPTH = 32, 16, 6

SENSOR = """<sensor type="perspective">
    <float name="fov" value="35"/>
    <transform name="to_world"><lookat origin="0, 2, 5" target="0, 0.6, 0" up="0, 1, 0"/></transform>
    {film}
  </sensor>"""
FILM = """<film type="hdrfilm">
      <integer name="width" value="32"/>
      <integer name="height" value="32"/>
      <rfilter type="box"/>
    </film>"""
FLOOR = """<shape type="rectangle">
    <transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf>
  </shape>"""
LAMP = """<shape type="rectangle">
    <transform name="to_world"><rotate x="1" angle="90"/><translate x="1.5" y="3" z="1"/></transform>
    <emitter type="area"><rgb name="radiance" value="4, 4.5, 5"/></emitter>
  </shape>"""
SKY = '<emitter type="constant"><rgb name="radiance" value="0.4"/></emitter>'
BALL = '<shape type="sphere"><point name="center" x="0" y="0.8" z="0"/><float name="radius" value="0.8"/>{}</shape>'
# A board that stands on the floor and leans back.
BOARD = ('<shape type="rectangle"><transform name="to_world"><scale x="1" y="0.8"/><rotate x="1" angle="-20"/>'
         '<translate y="0.8"/></transform>{}</shape>')
GREY = '<bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>'


def scene(thing, sensor=None, film=FILM, light=LAMP + SKY, floor=FLOOR, integrator=f'<integer name="max_depth" value="{DEPTH}"/>'):
    sensor = (sensor or SENSOR).format(film=film)
    parts = [f'<integrator type="path">{integrator}</integrator>', sensor, light, floor, thing]
    body = "\n  ".join(part for part in parts if part)
    return f'<?xml version="1.0" encoding="utf-8"?>\n<scene version="3.0.0">\n  {body}\n</scene>\n'


def ball(bsdf):
    return scene(BALL.format(bsdf))


def board(bsdf):
    return scene(BOARD.format(bsdf))


def bsdf(kind, *parameters):
    return f'<bsdf type="{kind}">{"".join(parameters)}</bsdf>'


def rgb(name, value):
    return f'<rgb name="{name}" value="{value}"/>'


def number(name, value):
    return f'<float name="{name}" value="{value}"/>'


def string(name, value):
    return f'<string name="{name}" value="{value}"/>'


def flag(name, value="true"):
    return f'<boolean name="{name}" value="{value}"/>'


def bitmap(parameter, file, *parameters):
    return f'<texture type="bitmap" name="{parameter}">{string("filename", file)}{"".join(parameters)}</texture>'


def attribute(parameter, name, *parameters):
    return f'<texture type="mesh_attribute" name="{parameter}">{string("name", name)}{"".join(parameters)}</texture>'


def emitter(kind, *parameters):
    return f'<emitter type="{kind}">{"".join(parameters)}</emitter>'


def placed(shape, *parameters, bsdf=GREY):
    transform = '<transform name="to_world"><rotate y="1" angle="25"/><scale value="0.7"/><translate y="0.8"/></transform>'
    return scene(f'<shape type="{shape}">{transform}{"".join(parameters)}{bsdf}</shape>')


def sensor(kind, *parameters):
    return f"""<sensor type="{kind}">{''.join(parameters)}
    <transform name="to_world"><lookat origin="0, 2, 5" target="0, 0.6, 0" up="0, 1, 0"/></transform>
    {{film}}</sensor>"""


def parallel(scale, *parameters):
    return sensor("orthographic", *parameters).replace("<lookat", f"<scale {scale}/><lookat")


def placed_box():
    """What is cut open by clipping planes."""
    return f'<shape type="cube"><transform name="to_world"><scale value="0.6"/><translate y="0.6"/></transform><bsdf type="twosided">{bsdf("diffuse", COLOURS)}</bsdf></shape>'


def painted(bsdf):
    return placed("ply", string("filename", "painted.ply"), bsdf=bsdf)


COLOURS = bitmap("reflectance", "colours.png")
UV = '<transform name="to_uv"><scale x="2.5" y="1.5"/><translate x="0.3" y="-0.2"/></transform>'
DIFFUSE = rgb("diffuse_reflectance", "0.3, 0.5, 0.7")
RED, BLUE = (bsdf("diffuse", rgb("reflectance", v)) for v in ("0.7, 0.2, 0.1", "0.1, 0.2, 0.7"))
SMALL = '<integer name="width" value="64"/><integer name="height" value="48"/>'
CROPPED = f'<film type="hdrfilm">{SMALL}<integer name="crop_offset_x" value="16"/><integer name="crop_offset_y" value="10"/><integer name="crop_width" value="32"/><integer name="crop_height" value="32"/><rfilter type="box"/></film>'

SCENES = {
    # Materials.
    "diffuse": ball(bsdf("diffuse", rgb("reflectance", "0.2, 0.5, 0.8"))),
    "dielectric": ball(bsdf("dielectric", string("int_ior", "bk7"), rgb("specular_transmittance", "0.9, 1, 0.8"))),
    "thindielectric": ball(bsdf("thindielectric", number("int_ior", 1.6))),
    "roughdielectric_ggx": ball(bsdf("roughdielectric", string("distribution", "ggx"), number("alpha", 0.3))),
    "roughdielectric_beckmann": ball(bsdf("roughdielectric", number("alpha", 0.15), number("int_ior", 1.33))),
    "conductor_gold": ball(bsdf("conductor", string("material", "Au"))),
    "conductor_copper_tinted": ball(bsdf("conductor", string("material", "Cu"), rgb("specular_reflectance", "0.5, 0.8, 1"))),
    "roughconductor_ggx": ball(bsdf("roughconductor", string("material", "Al"), string("distribution", "ggx"), number("alpha", 0.25))),
    "roughconductor_beckmann": ball(bsdf("roughconductor", string("material", "Cr"), number("alpha", 0.3))),
    "roughconductor_all_normals": ball(bsdf("roughconductor", string("material", "Ag"), string("distribution", "ggx"), number("alpha", 0.4), flag("sample_visible", "false"))),
    "roughconductor_anisotropic": board(bsdf("roughconductor", string("material", "Au"), string("distribution", "ggx"), number("alpha_u", 0.4), number("alpha_v", 0.1))),
    "plastic": ball(bsdf("plastic", DIFFUSE)),
    "plastic_nonlinear": ball(bsdf("plastic", DIFFUSE, number("int_ior", 1.9), flag("nonlinear"))),
    "roughplastic_beckmann": ball(bsdf("roughplastic", DIFFUSE, number("alpha", 0.15))),
    "roughplastic_ggx_nonlinear": ball(bsdf("roughplastic", DIFFUSE, string("distribution", "ggx"), number("alpha", 0.3), flag("nonlinear"))),
    "principled_metal": ball(bsdf("principled", rgb("base_color", "0.9, 0.6, 0.3"), number("metallic", 0.8), number("roughness", 0.4))),
    "principled_glass": ball(bsdf("principled", rgb("base_color", "0.9, 0.95, 1"), number("spec_trans", 0.9), number("roughness", 0.3), number("eta", 1.5))),
    "principled_coat": ball(bsdf("principled", rgb("base_color", "0.6, 0.2, 0.2"), number("roughness", 0.6), number("sheen", 0.6), number("clearcoat", 0.9), number("clearcoat_gloss", 0.6), number("spec_tint", 0.4))),
    "twosided": scene(BOARD.format(bsdf("twosided", RED, BLUE)).replace('angle="-20"', 'angle="200"')),
    "mask": board(bsdf("mask", bitmap("opacity", "grey.png"), RED)),
    "blendbsdf": board(bsdf("blendbsdf", bitmap("weight", "grey.png"), RED, bsdf("roughconductor", number("alpha", 0.3)))),
    "bumpmap": board(bsdf("bumpmap", bitmap("arbitrary", "waves.png", flag("raw")), number("scale", 0.3), bsdf("roughplastic", DIFFUSE))),
    "normalmap": board(bsdf("normalmap", bitmap("normalmap", "normals.png", flag("raw")), RED)),
    "null": ball(bsdf("null")),
    # Textures.
    "bitmap_repeat": board(bsdf("diffuse", bitmap("reflectance", "colours.png", UV))),
    "bitmap_mirror": board(bsdf("diffuse", bitmap("reflectance", "colours.png", string("wrap_mode", "mirror"), UV))),
    "bitmap_clamp": board(bsdf("diffuse", bitmap("reflectance", "colours.png", string("wrap_mode", "clamp"), string("filter_type", "nearest"), UV))),
    "bitmap_raw": board(bsdf("diffuse", bitmap("reflectance", "colours.png", flag("raw")))),
    "bitmap_jpeg": board(bsdf("diffuse", bitmap("reflectance", "colours.jpg"))),
    "bitmap_exr": board(bsdf("diffuse", bitmap("reflectance", "colours.exr"))),
    "bitmap_grey": board(bsdf("diffuse", bitmap("reflectance", "grey.png"))),
    "checkerboard": board(bsdf("diffuse", f'<texture type="checkerboard" name="reflectance">{rgb("color0", "0.7, 0.1, 0.1")}{rgb("color1", "0.1, 0.1, 0.6")}{UV}</texture>')),
    "bitmap_on_sphere": ball(bsdf("diffuse", COLOURS)),
    "bitmap_on_cylinder": scene(f'<shape type="cylinder"><point name="p0" x="-0.8" y="0.7" z="0"/><point name="p1" x="0.8" y="0.7" z="0.3"/><float name="radius" value="0.6"/><bsdf type="twosided">{bsdf("diffuse", COLOURS)}</bsdf></shape>'),
    "bitmap_on_disk": scene(f'<shape type="disk"><transform name="to_world"><scale value="0.8"/><rotate x="1" angle="-20"/><translate y="0.8"/></transform>{bsdf("diffuse", COLOURS)}</shape>'),
    "bitmap_on_cube": placed("cube", bsdf=bsdf("diffuse", COLOURS)),
    # Values of meshes.
    "attribute_vertex": painted(bsdf("diffuse", attribute("reflectance", "vertex_color", number("scale", 0.8)))),
    "attribute_face": painted(bsdf("diffuse", attribute("reflectance", "face_color"))),
    "attribute_bytes": scene(f'<shape type="ply">{string("filename", "bytes.ply")}{bsdf("diffuse", attribute("reflectance", "vertex_color", number("scale", 1 / 255)))}</shape>'),
    "attribute_mask": painted(bsdf("mask", attribute("opacity", "face_gap"), bsdf("twosided", RED))),
    "attribute_with_bitmap": painted(bsdf("blendbsdf", attribute("weight", "vertex_heat"), bsdf("diffuse", COLOURS), bsdf("roughconductor", attribute("alpha", "vertex_heat", number("scale", 0.5)), rgb("specular_reflectance", "0.9, 0.6, 0.4")))),
    "attribute_principled": painted(bsdf("principled", attribute("base_color", "vertex_color"), attribute("roughness", "face_gap"), bitmap("metallic", "grey.png"))),
    "attribute_normals": painted(bsdf("normalmap", attribute("normalmap", "vertex_tilt"), RED)),
    "attribute_with_bump": painted(bsdf("bumpmap", bitmap("arbitrary", "waves.png", flag("raw")), number("scale", 0.1), bsdf("diffuse", attribute("reflectance", "vertex_color")))),
    "attribute_mirrored": scene(f'<shape type="ply">{string("filename", "painted.ply")}<transform name="to_world"><scale x="-0.6" y="0.4" z="0.4"/><translate y="0.7"/></transform>{bsdf("twosided", bsdf("diffuse", attribute("reflectance", "vertex_color")))}</shape>'),
    # Of faces: values of vertices Mitsuba 3.9.1 interpolates in the wrong place on an instance.
    "attribute_instance": scene(f'<shape type="shapegroup" id="group"><shape type="ply">{string("filename", "painted.ply")}{bsdf("twosided", bsdf("diffuse", attribute("reflectance", "face_color")))}</shape></shape>'
                                '<shape type="instance"><ref id="group"/><transform name="to_world"><scale x="-0.6" y="0.4" z="0.4"/><translate y="0.7"/></transform></shape>'),
    # Emitters.
    "area_textured": scene(BALL.format(GREY), light=LAMP.replace(rgb("radiance", "4, 4.5, 5"), bitmap("radiance", "colours.png", flag("raw")))),
    "sunsky": scene(BALL.format(bsdf("roughconductor", number("alpha", 0.2))), light=emitter("sunsky", number("turbidity", 4), number("sun_aperture", 10), number("sun_scale", 0.5), number("sky_scale", 3), '<vector name="sun_direction" x="1" y="1.5" z="0.7"/>', '<transform name="to_world"><rotate x="1" angle="-90"/></transform>')),
    "sunsky_by_time": scene(BALL.format(bsdf("diffuse")), light=emitter("sunsky", *(number(name, value) for name, value in (("hour", 10), ("latitude", 48.2), ("longitude", 16.4), ("timezone", 2), ("sun_aperture", 20))), '<transform name="to_world"><rotate x="1" angle="-90"/><rotate y="1" angle="30"/></transform>')),
    "envmap": scene(BALL.format(bsdf("roughconductor", number("alpha", 0.2))), light=emitter("envmap", string("filename", "sky.exr"), number("scale", 1.5), '<transform name="to_world"><rotate y="1" angle="40"/></transform>')),
    "point": scene(BALL.format(GREY), light=emitter("point", '<point name="position" x="1" y="3" z="2"/>', rgb("intensity", "9, 10, 11"))),
    "spot": scene(BALL.format(GREY), light=emitter("spot", rgb("intensity", "30"), number("cutoff_angle", 25), number("beam_width", 15), '<transform name="to_world"><lookat origin="1, 4, 2" target="0, 0.4, 0" up="0, 0, 1"/></transform>')),
    "directional": scene(BALL.format(GREY), light=emitter("directional", rgb("irradiance", "2, 3, 4"), '<vector name="direction" x="-0.4" y="-1" z="-0.5"/>') + SKY),
    "hide_emitters": scene(BALL.format(GREY), integrator=f'<integer name="max_depth" value="{DEPTH}"/><boolean name="hide_emitters" value="true"/>'),
    # Shapes.
    "obj": placed("obj", string("filename", "knot.obj"), bsdf=bsdf("diffuse", COLOURS)),
    "obj_faces": placed("obj", string("filename", "knot.obj"), flag("face_normals")),
    "ply": placed("ply", string("filename", "knot.ply"), bsdf=bsdf("diffuse", COLOURS)),
    "serialized": placed("serialized", string("filename", "two.serialized"), '<integer name="shape_index" value="1"/>', bsdf=bsdf("diffuse", COLOURS)),
    "cylinder": placed("cylinder", flag("flip_normals")),
    "instance": scene(f'<shape type="shapegroup" id="group"><shape type="obj">{string("filename", "knot.obj")}{RED}</shape></shape>'
                      '<shape type="instance"><ref id="group"/><transform name="to_world"><scale value="0.4"/><translate x="-0.7" y="0.5"/></transform></shape>'
                      '<shape type="instance"><ref id="group"/><transform name="to_world"><rotate x="1" angle="60"/><scale value="0.4"/><translate x="0.7" y="0.6"/></transform></shape>'),
    # Sensors and films.
    "fov_axes": scene(BALL.format(GREY), sensor=sensor("perspective", number("fov", 40), string("fov_axis", "diagonal")), film=FILM.replace('width" value="32', 'width" value="48')),
    "focal_length": scene(BALL.format(GREY), sensor=sensor("perspective", string("focal_length", "60mm"))),
    "principal_point": scene(BALL.format(GREY), sensor=sensor("perspective", number("fov", 35), number("principal_point_offset_x", 0.2), number("principal_point_offset_y", -0.1))),
    "crop": scene(BALL.format(GREY), film=CROPPED),
    "thinlens": scene(BALL.format(GREY), sensor=sensor("thinlens", number("fov", 35), number("aperture_radius", 0.3), number("focus_distance", 4))),
    "orthographic": scene(BALL.format(bsdf("roughconductor", number("alpha", 0.2))), sensor=parallel('value="1.6"')),
    "orthographic_glass": scene(BALL.format(bsdf("dielectric")), sensor=parallel('value="1.6"')),
    "orthographic_clipped": scene(placed_box(), sensor=parallel('x="-1.6" y="1.2" z="2"', number("near_clip", 2.55), number("far_clip", 3.4)), film=FILM.replace('width" value="32', 'width" value="48')),
    "orthographic_crop": scene(BALL.format(GREY), sensor=parallel('value="2"'), film=CROPPED),
    # Values.
    "spectra": scene(BALL.format(bsdf("diffuse", '<spectrum name="reflectance" value="400:0.1, 500:0.2, 600:0.7, 700:0.6"/>')), light=LAMP.replace(rgb("radiance", "4, 4.5, 5"), '<spectrum name="radiance" value="400:2, 500:3, 600:5, 700:8"/>')),
}


def knot():
    """A lumpy ring with normals and texture coordinates."""
    from math import cos, pi, sin
    n, m = 24, 10
    at = lambda i, j: ((0.7 + 0.3 * cos(j)) * cos(i), (0.7 + 0.3 * cos(j)) * sin(i), 0.3 * sin(j) * (1 + 0.3 * sin(3 * i)))
    normal = lambda i, j: (cos(j) * cos(i), cos(j) * sin(i), sin(j))
    vertices = [(at(2 * pi * a / n, 2 * pi * b / m), normal(2 * pi * a / n, 2 * pi * b / m), (a / n * 2, b / m))
                for a in range(n + 1) for b in range(m + 1)]
    index = lambda a, b: a * (m + 1) + b
    quads = [(index(a, b), index(a + 1, b), index(a + 1, b + 1), index(a, b + 1)) for a in range(n) for b in range(m)]
    return vertices, quads


def write_meshes():
    vertices, quads = knot()
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    text = lambda values: " ".join(f"{v:.6f}" for v in values)
    lines = [f"v {text(p)}" for p, _, _ in vertices] + [f"vt {text(t)}" for _, _, t in vertices]
    lines += [f"vn {text(n)}" for _, n, _ in vertices]
    lines += ["f " + " ".join(f"{i + 1}/{i + 1}/{i + 1}" for i in quad) for quad in quads]
    (HERE / "knot.obj").write_text("\n".join(lines) + "\n")
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    head += [f"property float {name}" for name in "x y z nx ny nz u v".split()]
    head += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header"]
    body = b"".join(struct.pack("<8f", *p, *n, *t) for p, n, t in vertices)
    body += b"".join(struct.pack("<B3i", 3, *t) for t in triangles)
    (HERE / "knot.ply").write_bytes("\n".join(head).encode() + b"\n" + body)
    write_serialized(vertices, triangles)
    write_painted(vertices, triangles)


def write_painted(vertices, triangles):
    """The ring with values of vertices and faces, and a board whose vertices have colours of eight bits."""
    from math import cos, sin
    near = lambda i, k: 0.5 + 0.45 * sin(0.7 * i + 2.1 * k)
    tilt = lambda i: (0.5 + 0.2 * sin(0.5 * i), 0.5 + 0.2 * cos(0.3 * i), 0.9)
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    head += [f"property float {name}" for name in "x y z nx ny nz u v heat_0 b g r tilt_x tilt_y tilt_z".split()]
    head += [f"element face {len(triangles)}", "property list uchar int vertex_indices"]
    head += [f"property float {name}" for name in "r g b gap_0".split()] + ["end_header"]
    body = b"".join(struct.pack("<15f", *p, *n, *t, near(i, 3), *(near(i, k) for k in range(3)), *tilt(i))
                    for i, (p, n, t) in enumerate(vertices))
    body += b"".join(struct.pack("<B3i4f", 3, *t, *(near(3 * i, k) for k in range(4))) for i, t in enumerate(triangles))
    (HERE / "painted.ply").write_bytes("\n".join(head).encode() + b"\n" + body)
    lines = ["ply", "format ascii 1.0", "element vertex 6", *(f"property float {name}" for name in "xyz")]
    lines += [*(f"property uchar {name}" for name in ("red", "green", "blue")), "element face 4"]
    lines += ["property list uchar int vertex_indices", "end_header"]
    lines += ["-1 0 0.3 255 20 0", "0 0 0 0 255 0", "1 0 0.3 20 0 255", "-1 1.5 0 255 255 0", "0 1.5 -0.5 255 0 255", "1 1.5 0 9 99 200"]
    lines += ["3 0 1 4", "3 0 4 3", "3 1 2 5", "3 1 5 4"]
    (HERE / "bytes.ply").write_text("\n".join(lines) + "\n")


def write_serialized(vertices, triangles):
    """Two meshes: one triangle, and the ring with normals and texture coordinates."""
    def mesh(name, positions, normals, uvs, faces):
        flags = 0x1000 | (0x0001 if normals else 0) | (0x0002 if uvs else 0)
        flat = lambda rows: struct.pack(f"<{sum(map(len, rows))}f", *(v for row in rows for v in row)) if rows else b""
        data = struct.pack("<I", flags) + name.encode() + b"\0" + struct.pack("<QQ", len(positions), len(faces))
        data += flat(positions) + flat(normals) + flat(uvs)
        data += struct.pack(f"<{3 * len(faces)}I", *(i for face in faces for i in face))
        return struct.pack("<HH", 0x041C, 4) + zlib.compress(data)

    meshes = [mesh("one", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [], [(0, 1, 2)]),
              mesh("ring", *([v[k] for v in vertices] for k in range(3)), triangles)]
    offsets = [0, len(meshes[0])]
    (HERE / "two.serialized").write_bytes(b"".join(meshes) + struct.pack("<QQI", *offsets, len(meshes)))


def write_pictures(mi, np):
    from PIL import Image
    y, x = np.mgrid[0:12, 0:16]
    colours = np.stack([40 + 12 * x, 220 - 15 * y, (x * 37 + y * 91) % 256], -1).astype(np.uint8)
    Image.fromarray(colours).save(HERE / "colours.png")
    Image.fromarray(colours).resize((64, 48)).save(HERE / "colours.jpg", quality=95)
    Image.fromarray((30 + 13 * ((x + 2 * y) % 16)).astype(np.uint8), "L").save(HERE / "grey.png")
    y, x = np.mgrid[0:64, 0:64] / 64
    waves = 0.5 + 0.25 * np.sin(4 * np.pi * x) + 0.25 * np.cos(6 * np.pi * y)
    Image.fromarray((255 * waves).astype(np.uint8), "L").save(HERE / "waves.png")
    tilt = np.stack([0.3 * np.sin(4 * np.pi * x), 0.3 * np.cos(6 * np.pi * y), np.ones_like(x)], -1)
    tilt /= np.linalg.norm(tilt, axis=-1, keepdims=True)
    Image.fromarray(np.round(127.5 * tilt + 127.5).astype(np.uint8)).save(HERE / "normals.png")
    write(mi, np, (colours / 255.0) ** 2, mi.Struct.Type.Float16, HERE / "colours.exr")
    v, u = np.mgrid[0:16, 0:32] / np.array([16, 32])[:, None, None]
    sky = np.stack([0.2 + 0.6 * v, 0.3 + 0.3 * u, 0.9 - 0.5 * v], -1)
    sky[3:5, 20:22] = 12
    write(mi, np, sky, mi.Struct.Type.Float16, HERE / "sky.exr")


def write(mi, np, pixels, component, path):
    """Whole or not at all: to a file beside it, then by rename."""
    bitmap = mi.Bitmap(np.ascontiguousarray(pixels, dtype=np.float32))
    bitmap = bitmap.convert(mi.Bitmap.PixelFormat.RGB, component, srgb_gamma=False)
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        draft = pathlib.Path(folder) / path.name
        bitmap.write(str(draft))
        os.replace(draft, path)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--spp", type=int, default=4096, help="samples per pixel over all batches")
    parser.add_argument("--variant", default="scalar_rgb")
    args = parser.parse_args()

    import mitsuba as mi
    import numpy as np

    mi.set_variant(args.variant)
    mi.set_log_level(mi.LogLevel.Error)
    write_meshes()
    write_pictures(mi, np)
    for name in args.names or SCENES:
        (HERE / f"{name}.xml").write_text(SCENES[name])
        try:
            scene = mi.load_file(str(HERE / f"{name}.xml"))
            integrator = scene.integrator()
            integrator = mi.load_dict({"type": "path", "max_depth": DEPTH, "rr_depth": 1000, "hide_emitters": name == "hide_emitters"})
            images = [np.array(mi.render(scene, integrator=integrator, spp=args.spp // BATCHES, seed=seed), dtype=np.float64)[..., :3]
                      for seed in range(BATCHES)]
        except Exception as error:
            print(f"{name}: {str(error).strip().splitlines()[-1]}", flush=True)
            continue
        images = np.stack(images)
        mean, variance = images.mean(0), images.var(0, ddof=1) / BATCHES
        write(mi, np, mean, mi.Struct.Type.Float16, HERE / f"{name}.exr")
        write(mi, np, variance, mi.Struct.Type.Float32, HERE / f"{name}_var.exr")
        print(f"{name}: mean {mean.mean():.4f}, its error {100 * np.sqrt(variance.sum((0, 1))).mean() / mean[..., 0].size / mean.mean():.3f} %", flush=True)


if __name__ == "__main__":
    main()
