"""Heaps of the sixty from 0.7 m, at several resolutions: what the angle loses in a coarse photograph.

`python tests/measure/coarse.py` prints the table of docs/photograph_accuracy.md.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import sixty
from pinhole import Scene

from repose.measure.photographs import photograph as photographs

AWAY = 700.0  # mm
HIGH = 40, 50, 60, 80, 100, 140, 200  # pixels in the height of a heap
COUNT = 24  # heaps


def scene(number: int, high_px: float) -> Scene:
    fine = sixty.scene(number)
    high = fine.heaps[0].height
    focal = high_px * AWAY / high
    width = 8 * round(fine.size[0] * focal / fine.focal * -fine.eye[1] / AWAY / 8)
    return replace(
        fine, eye=(0.0, -AWAY, 0.9 * high), focal=focal, size=(width, 3 * width // 4)
    )


def measured(number: int, high_px: float, folder: Path) -> photographs.Photograph:
    """The photograph of such a heap, measured; its EXIF entry states the focal length."""
    return sixty.measured(
        scene(number, high_px), folder / f"{number}_{high_px}.png", focal_stated=True
    )


def rows(numbers: list[int], folder: Path) -> list[str]:
    """A table row for each resolution: number measured, and what differs from the finest photograph of the heap."""
    lines = []
    finest = {
        number: measured(number, HIGH[-1], folder).measurement for number in numbers
    }
    for high in HIGH[:-1]:
        found = {number: measured(number, high, folder) for number in numbers}
        seen = {
            number: seen_coarse.measurement
            for number, seen_coarse in found.items()
            if seen_coarse.measurement
        }
        colours = [
            number
            for number in seen
            if any("hardly differs" in doubt for doubt in found[number].doubts)
        ]
        both = [
            (seen[k], fine)
            for k, fine in finest.items()
            if fine and k in seen and k not in colours
        ]
        errors = np.array(
            [
                (
                    seen_coarse.aor_deg - fine.aor_deg,
                    seen_coarse.height_mm - fine.height_mm,
                )
                for seen_coarse, fine in both
            ]
        )
        most = np.abs(errors).max(axis=0)
        lines.append(
            f"| {high} | {len(seen)} | {len(colours)} | {errors[:, 0].mean():+.2f} | {most[0]:.2f} | "
            f"{errors[:, 1].mean():+.2f} | {most[1]:.2f} |"
        )
    return lines


def main() -> None:
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    numbers = [
        n
        for n in range(sixty.NUMBER)
        if not sixty.trouble(n) and sixty.plain(sixty.scene(n))
    ][:COUNT]
    with tempfile.TemporaryDirectory() as folder:
        print(*rows(numbers, Path(folder)), sep="\n")


if __name__ == "__main__":
    main()
