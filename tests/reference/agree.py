#!/usr/bin/env python3
"""Compares pathblend with Mitsuba 3 on any scenes, and prints a table.

    pip install mitsuba==3.9.1 numpy
    cargo build --release
    python3 tests/reference/agree.py SCENE.xml [...] [--width 96] [--spp 1024] [--depth 6]

Both render each scene by path tracing without Russian roulette, at a small size, in batches with seeds of their own.
The table has the ratio of the means, its standard error, how many standard errors the worst of the tiles is off, and
its probability if there were no difference (Student's t by Welch, Sidak over the tiles); the time that each takes to
load the scene; and whether the row is within the bounds: 3 standard errors or half a percent, and 1 in 1000 for the
worst tile, of which half a percent is forgiven too.

Files of Mitsuba 0.5 and 0.6 are rewritten for Mitsuba 3 where its own reader refuses them; pathblend reads them as they
are, unless Mitsuba 3 lacks what they ask for: then both read what is nearest to it, which stands in the last column.
"""
import argparse
import contextlib
import math
import os
import pathlib
import re
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


def film(match):
    """A film with nothing but what decides the image."""
    kept = re.findall(r'<integer name="(?:width|height)"[^>]*/>|<rfilter\b[^>]*/>', match.group(0))
    return '<film type="hdrfilm">' + "".join(kept) + "</film>"


def sun_aperture(match):
    """Mitsuba 3 has the sun's angle across in degrees, Mitsuba 0.6 a factor on its radius."""
    return f'<float name="sun_aperture" value="{0.5358 * float(match.group(1))}"/>'


def sunsky(match):
    """Mitsuba 3 has the zenith at +z and the west at +y where Mitsuba 0.6 has the zenith at +y and the east at +x: the
    sky is turned, and the sun's direction written out."""
    import mitsuba as mi
    import numpy as np

    text = match.group(0)
    found = re.search(r"<transform[^>]*>(.*?)</transform>", text, flags=re.S)
    inside = found.group(1) if found else ""
    rest = re.sub(r"<transform.*?</transform>", "", text, flags=re.S)
    parameters = "".join(re.findall(r'<(?:float|integer) name="(?:turbidity|sky_scale|sun_scale|sun_aperture)"[^>]*/>', rest))
    towards = re.search(r'<vector name="sun_?[dD]irection" x="([^"]*)" y="([^"]*)" z="([^"]*)"', rest)
    if towards:
        x, y, z = (float(number) for number in towards.groups())
    else:
        time = "".join(re.findall(r'<(?:float|integer) name="(?:hour|minute|second|year|month|day|latitude|longitude|timezone)"[^>]*/>', rest))
        south, west, up = mi.traverse(mi.load_string(f'<emitter version="3.0.0" type="sunsky">{time}</emitter>'))["sun_direction"]
        shape = mi.load_string(f'<shape version="3.0.0" type="rectangle"><transform name="to_world">{inside}</transform></shape>')
        x, y, z = np.array(mi.traverse(shape)["to_world"].matrix)[:3, :3] @ [-west, up, south]
    return (f'<emitter type="sunsky">{parameters}<vector name="sun_direction" x="{x}" y="{y}" z="{z}"/>'
            f'<transform name="to_world"><rotate x="1" angle="-90"/>{inside}</transform></emitter>')


def to_uv(match):
    """Mitsuba 0.6 scales, then shifts; Mitsuba 3 rewrites such files the other way round."""
    factors = dict(re.findall(r'<float\s+name\s*=\s*"([uv](?:scale|offset))"\s+value\s*=\s*"([^"]*)"\s*/>', match.group(0)))
    if not any(name.endswith("offset") for name in factors):
        return match.group(0)
    rest = re.sub(r'<float\s+name\s*=\s*"[uv](?:scale|offset)"[^>]*/>', "", match.group(0))
    transform = '<transform name="to_uv"><scale x="{}" y="{}"/><translate x="{}" y="{}"/></transform></texture>'
    numbers = [factors.get(name, default) for name, default in (("uscale", 1), ("vscale", 1), ("uoffset", 0), ("voffset", 0))]
    return rest.replace("</texture>", transform.format(*numbers))


def upgrade(text):
    """The scene as Mitsuba 3 takes it, and what was changed about it."""
    notes = []

    def edit(pattern, replacement, note, flags=re.S):
        nonlocal text
        text, count = re.subn(pattern, replacement, text, flags=flags)
        if count and note:
            notes.append(note)

    edit(r"<dpt>.*?</dpt>", "", None)
    edit(r'<boolean name="usePathGuiding"[^>]*/>', "", None)
    edit(r'(<bsdf\b[^>]*type="(?:conductor|dielectric)"[^>]*>(?:(?!</bsdf>).)*?)<float name="alpha"[^>]*/>', r"\1", None)
    edit(r'<sampler\b[^>]*/>', "", None)
    edit(r'<sampler\b.*?</sampler>', "", None)
    edit(r'<film type="ldrfilm"', '<film type="hdrfilm"', None)
    text = re.sub(r"<film\b.*?</film>", film, text, flags=re.S)
    edit(r'<float name="samplingWeight"[^>]*/>', "", None)
    edit(r'<(?:string|float) name="extEta"[^>]*/>', "", None)
    edit(r'<float name="uvscale" value="([^"]*)"\s*/>', r'<transform name="to_uv"><scale x="\1" y="\1"/></transform>', None)
    edit(r'<(?:float|integer) name="sunRadiusScale" value="([^"]*)"\s*/>', sun_aperture, None)
    text = re.sub(r'name="(sky|sun)Scale"', r'name="\1_scale"', text)
    edit(r'<emitter type="sunsky".*?</emitter>', sunsky, "sky turned, Mitsuba 3's sun")
    text = re.sub(r"<texture\b[^>]*[^/]>.*?</texture>", to_uv, text, flags=re.S)
    edit(r'"trilinear"', '"bilinear"', None)
    edit(r'"ewa"', '"bilinear"', None)
    edit(r'<spectrum( name="[^"]*") value="([^":]*)"\s*/>', r'<rgb\1 value="\2"/>', None)
    edit(r'<srgb( name="[^"]*") value="([^",]*)"\s*/>', r'<rgb\1 value="\2"/>', None)
    edit(r'type="phong"', 'type="roughplastic"', "phong as roughplastic")
    edit(r'<float name="exponent"[^>]*/>', "", None)
    return text, notes


@contextlib.contextmanager
def rewritten(path):
    """The scene as Mitsuba 3 takes it, in a folder with everything it refers to, and what was changed about it."""
    text = path.read_text()
    notes = []
    # Whatever integrator the file asks for: this script brings its own.
    text = re.sub(r"<integrator\b[^>]*/>|<integrator\b.*?</integrator>", "", text, flags=re.S)
    version = re.search(r'<scene[^>]*version="(\d+)', text)
    if version and int(version.group(1)) < 3:
        text, notes = upgrade(text)
        if notes:
            # What is nearest to it is a file of version 3, also for pathblend.
            text = re.sub(r'(<scene[^>]*version=")[^"]*', r"\g<1>3.0.0", text, count=1)
            text = re.sub(r'(?<= name=")[^"]*', lambda name: re.sub("(?<=[a-z])[A-Z]+", lambda m: "_" + m[0].lower(), name[0]), text)
            text = text.replace("<lookAt", "<lookat")
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for entry in path.parent.iterdir():
            if entry.name != path.name:
                (folder / entry.name).symlink_to(entry.resolve())
        (folder / path.name).write_text(text)
        yield folder / path.name, notes


def mitsuba_batches(mi, np, path, size, args):
    wall = time.perf_counter()
    scene = mi.load_file(str(path))
    load = time.perf_counter() - wall
    sensor = scene.sensors()[0]
    parameters = mi.traverse(sensor)
    parameters["film.size"] = list(size)
    parameters.update()
    integrator = mi.load_dict({"type": "path", "max_depth": args.depth, "rr_depth": 1000})
    images = []
    for seed in range(args.batches):
        image = mi.render(scene, integrator=integrator, sensor=sensor, spp=max(1, args.spp // args.batches), seed=seed)
        images.append(np.array(image, dtype=np.float64)[..., :3])
    return np.stack(images), load


def film_size(path, width):
    text = path.read_text()
    number = {}
    for name in ("width", "height"):
        found = re.search(rf'name="{name}" value="(\$?\w+)"', text)
        value = found.group(1) if found else ("768" if name == "width" else "576")
        if value.startswith("$"):
            value = re.search(rf'<default name="{value[1:]}" value="(\d+)"', text).group(1)
        number[name] = int(value)
    return width, max(1, round(width * number["height"] / number["width"]))


def own_batches(mi, np, path, size, args):
    images = []
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "out.exr"
        command = [args.pathblend, "render", str(path), "-i", args.integrator, "--no-features", "--size",
                   f"{size[0]}x{size[1]}", "--max-depth", str(args.depth), "-o", str(out)]
        run = lambda extra: subprocess.run(command + extra, capture_output=True, text=True)
        for seed in range(args.batches):
            done = run(["--passes", str(max(1, args.spp // args.batches)), "--seed", str(seed)])
            if done.returncode:
                return None, done.stderr.strip().splitlines()[0] if done.stderr else "failed"
            bitmap = mi.Bitmap(str(out)).convert(component_format=mi.Struct.Type.Float32, srgb_gamma=False)
            images.append(np.array(bitmap, dtype=np.float64)[..., :3])
        tiny = ["--passes", "1", "--threads", "2"]
        command[command.index("--size") + 1] = "1x1"
        start = time.perf_counter()
        run(tiny)
        load = time.perf_counter() - start
    return np.stack(images), load


def tiles(np, images, side):
    luminance = images @ np.array([0.2126, 0.7152, 0.0722])
    count, height, width = luminance.shape
    rows, columns = max(1, height // side), max(1, width // side)
    cut = luminance[:, : rows * (height // rows), : columns * (width // columns)]
    return cut.reshape(count, rows, height // rows, columns, width // columns).mean((2, 4)).reshape(count, -1)


def row(np, stats, ours, theirs, side):
    a, b = tiles(np, ours, side), tiles(np, theirs, side)
    n = len(a)
    whole_a, whole_b = a.mean(1), b.mean(1)
    error = math.sqrt((whole_a.var(ddof=1) + whole_b.var(ddof=1)) / n)
    ratio = whole_a.mean() / whole_b.mean()
    z = (whole_a.mean() - whole_b.mean()) / error
    va, vb = a.var(0, ddof=1) / n, b.var(0, ddof=1) / n
    difference = a.mean(0) - b.mean(0)
    excess = np.maximum(np.abs(difference) - 0.005 * np.abs(b.mean(0)), 0)
    se = np.sqrt(va + vb) + 1e-12
    freedom = (va + vb) ** 2 / np.maximum((va**2 + vb**2) / (n - 1), 1e-300)
    p = 2 * stats.t.sf(excess / se, np.maximum(freedom, 1))
    worst = int(np.argmin(p))
    sidak = -math.expm1(len(p) * math.log1p(-min(p[worst], 1 - 1e-16)))
    fine = (abs(z) < 3 or abs(ratio - 1) < 0.005) and sidak > 1e-3
    return ratio, error / whole_b.mean(), z, difference[worst] / max(b.mean(0)[worst], 1e-12), sidak, fine


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", type=pathlib.Path)
    parser.add_argument("--width", type=int, default=96)
    parser.add_argument("--spp", type=int, default=1024)
    parser.add_argument("--batches", type=int, default=16)
    parser.add_argument("--depth", type=int, default=6)
    parser.add_argument("--tile", type=int, default=16)
    parser.add_argument("--integrator", default="path")
    parser.add_argument("--variant", default="scalar_rgb")
    parser.add_argument("--pathblend", default=str(ROOT / "target/release/pathblend"))
    parser.add_argument("--pictures", type=pathlib.Path, help="folder for both means as PNG")
    args = parser.parse_args()

    import mitsuba as mi
    import numpy as np
    from scipy import stats

    mi.set_variant(args.variant)
    mi.set_log_level(mi.LogLevel.Error)
    print("| scene | mean | ratio | s.e. | z | worst tile | its p | load, s | Mitsuba | agrees | rewritten |")
    print("|---|---|---|---|---|---|---|---|---|---|---|", flush=True)
    for path in args.scenes:
        path = path / "scene.xml" if path.is_dir() else path
        name = path.parent.name if path.name == "scene.xml" else path.stem
        size = film_size(path, args.width)
        try:
            with rewritten(path) as (newer, notes):
                ours, load = own_batches(mi, np, newer if notes else path, size, args)
                if ours is None:
                    print(f"| {name} | pathblend: {load} |", flush=True)
                    continue
                theirs, wall = mitsuba_batches(mi, np, newer, size, args)
        except Exception as error:  # the table goes on with the next scene
            print(f"| {name} | Mitsuba: {str(error).strip().splitlines()[-1]} |", flush=True)
            continue
        if args.pictures:
            args.pictures.mkdir(parents=True, exist_ok=True)
            for which, images in (("pathblend", ours), ("mitsuba", theirs)):
                bitmap = mi.Bitmap(np.ascontiguousarray(images.mean(0), dtype=np.float32))
                bitmap = bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8, srgb_gamma=True)
                bitmap.write(str(args.pictures / f"{name}_{which}.png"))
        ratio, se, z, off, p, fine = row(np, stats, ours, theirs, args.tile)
        level = (theirs @ np.array([0.2126, 0.7152, 0.0722])).mean()
        print(f"| {name} | {level:.4g} | {ratio:.4f} | {se:.4f} | {z:+.1f} | {100 * off:+.1f} % | {p:.2g} | {load:.2f} "
              f"| {wall:.2f} | {'yes' if fine else 'NO'} | {', '.join(notes)} |", flush=True)


if __name__ == "__main__":
    main()
