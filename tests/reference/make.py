#!/usr/bin/env python3
"""Renders the reference images of the tests with Mitsuba 3, a renderer of other people's.

    pip install mitsuba==3.9.1 numpy
    python3 tests/reference/make.py [SCENE ...] [--light] [--quick]

For each scene (all by default) it writes beside itself
    SCENE.exr       mean of 16 independent batches, half float, 64x64, linear RGB
    SCENE_var.exr   variance of that mean per pixel and channel, single float
and prints a row of the README's table. With --light the scenes with caustics are rendered by tracing light (`ptracer`),
to SCENE_light.exr and SCENE_light_var.exr. --quick renders a 64th of the samples.
"""
import argparse
import os
import pathlib
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
SCENES = HERE.parent.parent / "scenes"
SIDE = 64
BATCHES = 16
MAX_DEPTH = 9
RR_DEPTH = 100  # beyond MAX_DEPTH: no Russian roulette
# Samples per pixel over all batches: half a minute to three minutes for each scene on one core.
SPP = {
    "box": 8192,
    "spheres": 16384,
    "plates": 4096,
    "door": 3072,
    "torus": 8192,
    "ring": 8192,
    "lamp": 4096,
    "gallery": 2048,
    "pool": 8192,
    "bokeh": 4096,
    "porch": 2048,
    "window": 8192,
}
# The same for light tracing, where there are caustics.
LIGHT_SPP = {"spheres": 2048, "torus": 2048, "ring": 2048, "lamp": 2048, "pool": 2048}


def render(mi, np, name, spp, kind):
    """Mean and variance of the mean; batch k has seed k."""
    scene = mi.load_file(str(SCENES / name / "scene.xml"), width=str(SIDE), height=str(SIDE))
    integrator = mi.load_dict({"type": kind, "max_depth": MAX_DEPTH, "rr_depth": RR_DEPTH})
    batches = []
    for seed in range(BATCHES):
        image = mi.render(scene, integrator=integrator, spp=spp // BATCHES, seed=seed)
        batches.append(np.array(image, dtype=np.float64)[..., :3])
    batches = np.stack(batches)
    return batches.mean(0), batches.var(0, ddof=1) / BATCHES


def write(mi, np, pixels, component, path):
    """Whole or not at all: to a file beside it, then by rename."""
    bitmap = mi.Bitmap(np.ascontiguousarray(pixels, dtype=np.float32))
    bitmap = bitmap.convert(mi.Bitmap.PixelFormat.RGB, component, srgb_gamma=False)
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        draft = pathlib.Path(folder) / path.name
        bitmap.write(str(draft))
        os.replace(draft, path)


def main():
    args = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    args.add_argument("scenes", nargs="*", metavar="SCENE", help=", ".join(SPP))
    args.add_argument("--light", action="store_true", help="by tracing light")
    args.add_argument("--quick", action="store_true", help="a 64th of the samples, to try the script")
    args.add_argument("--out", type=pathlib.Path, default=HERE, help="folder to write to")
    args = args.parse_args()
    kind, suffix, table = ("ptracer", "_light", LIGHT_SPP) if args.light else ("path", "", SPP)
    unknown = set(args.scenes) - set(table)
    if unknown:
        raise SystemExit(f"unknown scenes: {', '.join(sorted(unknown))}; there are {', '.join(table)}")

    import drjit
    import mitsuba as mi
    import numpy as np

    mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Warn)
    args.out.mkdir(parents=True, exist_ok=True)
    for name in args.scenes or table:
        spp = table[name] // 64 if args.quick else table[name]
        drjit.set_thread_count(1)
        mean, variance = render(mi, np, name, spp, kind)
        # Mitsuba 3.9.1 writes EXR files on the thread pool and hangs where that has one thread.
        drjit.set_thread_count(2)
        write(mi, np, mean, mi.Struct.Type.Float16, args.out / f"{name}{suffix}.exr")
        write(mi, np, variance, mi.Struct.Type.Float32, args.out / f"{name}{suffix}_var.exr")
        deviation = np.sqrt(variance.mean(-1))
        level = mean.mean(-1)
        whole = np.sqrt(variance.sum((0, 1))).mean() / (SIDE * SIDE) / level.mean()
        rms = np.sqrt(variance.mean()) / level.mean()
        typical = np.median(deviation / np.maximum(level, 0.01))
        print(f"| {name} | {spp} | {level.mean():.4f} | {100 * rms:.1f} % | {100 * typical:.1f} % "
              f"| {100 * whole:.2f} % |", flush=True)


if __name__ == "__main__":
    main()
