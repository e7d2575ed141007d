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
        n_measured = 0
        n_pale = 0
        differences = []
        for number in numbers:
            photograph = measured(number, high, folder)
            coarse = photograph.measurement
            fine = finest[number]
            if coarse is None:
                continue
            n_measured += 1
            if any("hardly differs" in warning for warning in photograph.warnings):
                n_pale += 1
            elif fine is not None:
                angle = coarse.aor_deg - fine.aor_deg
                height = coarse.height_mm - fine.height_mm
                differences.append((angle, height))
        mean_angle, mean_height = np.mean(differences, axis=0)
        largest_angle, largest_height = np.abs(differences).max(axis=0)
        lines.append(
            f"| {high} | {n_measured} | {n_pale} | {mean_angle:+.2f} | {largest_angle:.2f} | "
            f"{mean_height:+.2f} | {largest_height:.2f} |"
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
