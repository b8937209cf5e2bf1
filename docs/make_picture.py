#!/usr/bin/env python3
"""Makes docs/auto.png: the two inputs, the weights, the blend and a reference, side by side.

    cargo build --release && python3 docs/make_picture.py [SCENE]

Needs Pillow. Takes some minutes, most of them for the reference.
"""
import pathlib
import subprocess
import sys
import tempfile

from PIL import Image, ImageDraw

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCENE = sys.argv[1] if len(sys.argv) > 1 else "torus"
PROGRAM = ROOT / "target/release/pathblend"
FILE = ROOT / "scenes" / SCENE / "scene.xml"

with tempfile.TemporaryDirectory() as folder:
    folder = pathlib.Path(folder)

    def run(*arguments):
        return subprocess.run([PROGRAM, *map(str, arguments)], check=True, capture_output=True, text=True).stdout

    run("auto", FILE, "--time", "30s", "--keep", "-o", folder / "x.exr")
    run("render", FILE, "-i", "path", "--time", "90s", "-o", folder / "r.exr", "--png", folder / "r.png")
    names = {"x_bdpt": "bdpt, 15 s", "x_sppm": "sppm, 15 s", "x_weight": "weights", "x": "blend", "r": "path, 90 s"}
    pictures = []
    for name, label in names.items():
        picture = Image.open(folder / f"{name}.png").convert("RGB")
        if name in ("x_bdpt", "x_sppm", "x"):
            rmse = next(line.split()[1] for line in run("compare", folder / f"{name}.exr", folder / "r.exr").splitlines() if line.startswith("RMSE"))
            label += f"  (RMSE {float(rmse):.3f})"
        framed = Image.new("RGB", (picture.width, picture.height + 18), "white")
        framed.paste(picture, (0, 0))
        ImageDraw.Draw(framed).text((4, picture.height + 4), label, fill="black")
        pictures.append(framed)
    sheet = Image.new("RGB", (sum(p.width + 4 for p in pictures) - 4, pictures[0].height), "white")
    x = 0
    for picture in pictures:
        sheet.paste(picture, (x, 0))
        x += picture.width + 4
    sheet.save(ROOT / "docs/auto.png")
