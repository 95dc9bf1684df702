#!/usr/bin/env python3
"""Draws the course of a training as SVG.

    curve.py LOG.csv OUT.svg [--components 4] [--baselines FILE]

Above the loss, below the relMSE of each held-out frame over the hours, both logarithmic; dashed, what prefiltered Open
Image Denoise reaches there by a table of baselines.
"""

import argparse
import csv
import math
from pathlib import Path

from evaluate import read_baselines

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 720, 240, 70, 130, 28, 34
COLOURS = ("#1f6feb", "#d1242f", "#1a7f37", "#8250df", "#bf8700", "#57606a")


def read_log(path, components):
    """The loss and each frame's relMSE as [(hours, value)]."""
    loss, errors = {}, {}
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            hours = float(row["hours"])
            loss[hours] = float(row["loss"])
            if row["frame"] and int(row["components"]) == components and float(row["relmse"]) > 0:
                errors.setdefault(row["frame"], []).append((hours, float(row["relmse"])))
    return {"loss": sorted(loss.items())}, errors


def ticks(low, high):
    """1, 2 and 5 times the powers of ten within a range."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return [m * 10.0**p for p in powers for m in (1, 2, 5) if low <= m * 10.0**p <= high]


def hour_ticks(last):
    step = next((s for s in (0.1, 0.25, 0.5, 1, 2, 5, 10) if last / s <= 8), 24)
    return [i * step for i in range(int(last / step) + 1)]


def chart(lines, references, title, top):
    """One panel with its origin `top` pixels down."""
    values = [y for line in lines.values() for _, y in line] + [y for name, y in references.items() if name in lines]
    low, high = min(values) / 1.1, max(values) * 1.1
    last = max(x for line in lines.values() for x, _ in line) or 1

    def place(x, y):
        across = LEFT + (WIDTH - LEFT - RIGHT) * x / last
        down = top + TOP + (HEIGHT - TOP - BOTTOM) * math.log(high / y) / math.log(high / low)
        return f"{across:.1f}", f"{down:.1f}"

    parts = [f'<text x="{LEFT}" y="{top + 16}" font-weight="bold">{title}</text>']
    for value in ticks(low, high):
        _, y = place(0, value)
        parts.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y}" y2="{y}" stroke="#d8dee4"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y}" text-anchor="end" dominant-baseline="middle">{value:g}</text>')
    for hour in hour_ticks(last):
        x, y = place(hour, low)
        parts.append(f'<text x="{x}" y="{float(y) + 16:.1f}" text-anchor="middle">{hour:g} h</text>')
    for i, (name, line) in enumerate(lines.items()):
        colour = COLOURS[i % len(COLOURS)]
        points = " ".join(",".join(place(x, y)) for x, y in line)
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.6"/>')
        _, y = place(*line[-1])
        parts.append(f'<text x="{WIDTH - RIGHT + 6}" y="{y}" dominant-baseline="middle" fill="{colour}">{name}</text>')
        if name in references:
            _, y = place(0, references[name])
            dashed = f'stroke="{colour}" stroke-dasharray="5 4"'
            parts.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y}" y2="{y}" {dashed}/>')
    return parts


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--components", type=int, default=4)
    parser.add_argument("--baselines", type=Path)
    options = parser.parse_args(arguments)
    loss, errors = read_log(options.log, options.components)
    references = read_baselines(options.baselines) if options.baselines else {}
    parts = chart(loss, {}, "Loss in training (SMAPE)", 0)
    if errors:
        title = f"relMSE of held-out frames, K = {options.components}"
        parts += chart(errors, references, title + (" (dashed: Open Image Denoise)" if references else ""), HEIGHT)
    height = 2 * HEIGHT if errors else HEIGHT
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}" font-family="sans-serif" font-size="12">'
    body = "\n".join([head, f'<rect width="{WIDTH}" height="{height}" fill="white"/>', *parts, "</svg>", ""])
    options.out.write_text(body)


if __name__ == "__main__":
    main()
