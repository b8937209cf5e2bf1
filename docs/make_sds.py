#!/usr/bin/env python3
"""Makes docs/sds.png: scenes with light that goes through glass, off a diffuse surface, and through glass again, by chains
and by photons; below, where that light is too dark (blue) and too bright (orange), against photons.

    cargo build --release && python3 docs/make_sds.py

Needs Pillow. Takes five minutes.
"""
import pathlib
import subprocess
import tempfile

from PIL import Image, ImageDraw

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = ROOT / "target/release/pathblend"
SCENES = ["torus", "pool", "spheres"]
METHODS = {"rjmlt": "15s", "mlt": "15s", "fused": "15s", "sppm": "60s"}
SIZE, LABEL = 128, 16

sheet = Image.new("RGB", (len(METHODS) * (SIZE + 4) - 4, len(SCENES) * (2 * SIZE + LABEL + 8)), "white")
draw = ImageDraw.Draw(sheet)
with tempfile.TemporaryDirectory() as folder:
    folder = pathlib.Path(folder)

    def run(*arguments):
        return subprocess.run([PROGRAM, *map(str, arguments)], check=True, capture_output=True, text=True).stdout

    for row, scene in enumerate(SCENES):
        top = row * (2 * SIZE + LABEL + 8)
        for method, time in METHODS.items():
            out = folder / f"{method}.exr"
            run("render", ROOT / "scenes" / scene / "scene.xml", "-i", method, "--time", time, "--threads", 1,
                "--size", f"{SIZE}x{SIZE}", "-o", out, "--png", out.with_suffix(".png"))
        for column, (method, time) in enumerate(METHODS.items()):
            left, out = column * (SIZE + 4), folder / f"{method}.exr"
            text = f"{method}, {time[:-1]} s"
            sheet.paste(Image.open(out.with_suffix(".png")).convert("RGB"), (left, top + LABEL))
            if method != "sppm":
                reference, picture = folder / "sppm.exr", folder / "map.png"
                table = run("compare", out, reference, "--classes", "SDS", "--map", picture)
                error = next(line.split()[1] for line in table.splitlines() if line.startswith("relMSE"))
                text += f": {float(error):.3f}"
                sheet.paste(Image.open(picture).convert("RGB"), (left, top + LABEL + SIZE + 4))
            draw.text((left + 2, top + 2), text, fill="black")
sheet.save(ROOT / "docs/sds.png")
