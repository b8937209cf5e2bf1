#!/usr/bin/env python3
"""Shows that the tests can fail: applies each fault of this folder to a copy of the last commit, and runs the test that
has to notice it.

    python3 tests/faults/run.py [NAME ...]

A fault is a unified diff whose first lines say what is wrong (`Fault:`) and which test turns red (`Test:`, the arguments
of `cargo test`). Prints a table; fails where a test stays green, a fault does not apply, or does not compile. The copy is
a git worktree beside what is built for it, in target/faults: always in the same place, so that little has to be built
anew, and apart from what is built of the tree itself, which cargo could not tell from it.
"""

import os
import subprocess
import sys
import time
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
ROOT = FOLDER.parent.parent
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve() / "faults"
COPY = TARGET / "copy"


def header(patch: Path) -> dict[str, str]:
    """The lines `Key: value` before the diff."""
    lines = patch.read_text().split("\n--- ", 1)[0].splitlines()
    return dict(line.split(": ", 1) for line in lines if ": " in line)


def run(*command: str) -> subprocess.CompletedProcess:
    environment = {**os.environ, "CARGO_TARGET_DIR": str(TARGET)}
    return subprocess.run(command, cwd=COPY, env=environment, capture_output=True, text=True)


def outcome(patch: Path) -> str:
    """What the test says of the fault: red is what is hoped for."""
    test = header(patch)["Test"].split()
    if run("git", "apply", str(patch)).returncode != 0:
        return "does not apply"
    try:
        # A fault that does not compile, or a test that is not there, would pass for red below.
        if run("cargo", "test", "--quiet", "--no-run", *test[:2]).returncode != 0:
            return "does not compile"
        result = run("cargo", "test", "--quiet", *test)
        if "0 passed; 0 failed" in result.stdout:
            return "no such test"
        return "green" if result.returncode == 0 else "red"
    finally:
        run("git", "checkout", "--quiet", ".")


def main() -> int:
    names = sys.argv[1:] or sorted(patch.stem for patch in FOLDER.glob("*.patch"))
    failed = []
    print("| fault | what is wrong | test | outcome | seconds |\n|---|---|---|---|---|")
    forget = ["git", "worktree", "remove", "--force", str(COPY)]
    subprocess.run(forget, cwd=ROOT, capture_output=True)  # what a run that was stopped has left
    subprocess.run(["git", "worktree", "add", "--quiet", "--detach", str(COPY), "HEAD"], cwd=ROOT, check=True)
    try:
        for name in names:
            patch, start = FOLDER / f"{name}.patch", time.monotonic()
            result, about = outcome(patch), header(patch)
            seconds = time.monotonic() - start
            print(f"| {name} | {about['Fault']} | {about['Test']} | {result} | {seconds:.0f} |", flush=True)
            failed += [name] if result != "red" else []
    finally:
        subprocess.run(forget, cwd=ROOT, check=True)
    if failed:
        print(f"not red: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
