#!/usr/bin/env python3
"""Compares the time that pathblend and Mitsuba 3 take to load scenes, and prints a table.

    pip install mitsuba==3.9.1
    apt install time
    cargo build --release
    python3 tests/reference/load_times.py SCENE.xml [...] [--runs 7]

Ours is a whole process: start, read, build the hierarchy, render one pixel, write it. Mitsuba's is `load_file` alone, in
a process that has loaded its variant before. The runs of both alternate, each in a process of its own, so that what else
the machine does falls on both; times are medians of wall time. Bytes per triangle are the peak memory of our process
above that of an empty scene, less the pixels of its textures (as many bytes a channel as in the file).

Files of Mitsuba 0.5 and 0.6 are rewritten for Mitsuba 3 as in `agree.py`. The bar is a ratio of at most 1.5, and 250
bytes per triangle where a scene has at least 100000 triangles: with fewer, files and buffers weigh more than the scene.
"""
import argparse
import json
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
import time

from agree import ROOT, upgrade

MANY = 100_000
WORST_RATIO = 1.5
MOST_BYTES = 250

EMPTY = """<scene version="3.0.0"><sensor type="perspective"/><emitter type="constant"/></scene>"""

# Runs in a process of its own: loads the scene, and says how long that took and what is in it.
CHILD = """
import json, sys, time
import mitsuba as mi
mi.set_variant(sys.argv[2])
mi.set_log_level(mi.LogLevel.Error)
mi.load_dict({"type": "sphere"})
start = time.perf_counter()
scene = mi.load_file(sys.argv[1])
seconds = time.perf_counter() - start
triangles = sum(shape.face_count() for shape in scene.shapes() if isinstance(shape, mi.Mesh))
print(json.dumps([seconds, triangles]))
"""


def for_mitsuba(path, folder):
    """A copy of the scene that Mitsuba 3 can read, in `folder`."""
    text = path.read_text()
    # Whatever integrator the file asks for: ours does not build it either.
    text = re.sub(r"<integrator\b[^>]*/>|<integrator\b.*?</integrator>", "", text, flags=re.S)
    version = re.search(r'<scene[^>]*version="(\d+)', text)
    if version and int(version.group(1)) < 3:
        text, _ = upgrade(text)
    for entry in path.parent.iterdir():
        if entry.name != path.name:
            (folder / entry.name).symlink_to(entry.resolve())
    (folder / path.name).write_text(text)
    return folder / path.name


def command(args, path, out):
    return [args.pathblend, "render", str(path), "-i", "path", "--passes", "1", "--size", "1x1", "--threads",
            str(args.threads), "-o", str(out)]


def ours(args, path, out):
    """Seconds."""
    start = time.perf_counter()
    done = subprocess.run(command(args, path, out), capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError("pathblend: " + done.stderr.strip().splitlines()[0])
    return time.perf_counter() - start


def memory(args, path, out):
    """Peak memory in bytes. Asked of GNU time: a child of this process would inherit its peak."""
    done = subprocess.run(["time", "-f", "%M"] + command(args, path, out), capture_output=True, text=True)
    return int(done.stderr.split()[-1]) * 1024


def theirs(args, path):
    """Seconds, and number of triangles."""
    command = [sys.executable, "-c", CHILD, str(path), args.variant]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError("Mitsuba: " + (done.stderr.strip().splitlines() or ["failed"])[-1])
    return json.loads(done.stdout.splitlines()[-1])


def texture_bytes(mi, path):
    """Bytes of all pixels of the images that a scene names."""
    total = 0
    for name in sorted(set(re.findall(r'name="filename"\s+value="([^"]+)"', path.read_text()))):
        if pathlib.Path(name).suffix.lower() in (".png", ".jpg", ".jpeg", ".tga", ".bmp", ".hdr", ".exr"):
            if not (path.parent / name).exists():  # an output
                continue
            bitmap = mi.Bitmap(str(path.parent / name))
            channels = 1 if bitmap.channel_count() < 3 else 3
            depth = bitmap.bytes_per_pixel() // bitmap.channel_count()
            total += bitmap.width() * bitmap.height() * channels * depth
    return total


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", type=pathlib.Path)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--variant", default="scalar_rgb")
    parser.add_argument("--pathblend", default=str(ROOT / "target/release/pathblend"))
    args = parser.parse_args()

    import mitsuba as mi

    mi.set_variant(args.variant)
    print("| scene | triangles | ours, s | Mitsuba, s | ratio | bytes per triangle | within the bar |")
    print("|---|---|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        out, empty = folder / "out.exr", folder / "empty.xml"
        empty.write_text(EMPTY)
        trivial = memory(args, empty, out)
        for path in args.scenes:
            path = path / "scene.xml" if path.is_dir() else path
            name = path.parent.name if path.name == "scene.xml" else path.stem
            own, other = [], []
            try:
                with tempfile.TemporaryDirectory() as copy:
                    copy = for_mitsuba(path, pathlib.Path(copy))
                    for _ in range(args.runs):
                        own.append(ours(args, path, out))
                        other.append(theirs(args, copy))
                above = memory(args, path, out) - trivial - texture_bytes(mi, path)
            except RuntimeError as error:  # the table goes on with the next scene
                print(f"| {name} | {error} |", flush=True)
                continue
            a, b = statistics.median(own), statistics.median(run[0] for run in other)
            triangles = other[0][1]
            each = above / max(triangles, 1)
            fine = a / b <= WORST_RATIO and (triangles < MANY or each <= MOST_BYTES)
            print(f"| {name} | {triangles} | {a:.3f} | {b:.3f} | {a / b:.2f} | {each:.0f} | {'yes' if fine else 'NO'} |",
                  flush=True)


if __name__ == "__main__":
    main()
