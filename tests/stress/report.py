#!/usr/bin/env python3
"""Makes docs/stability.md of what the stress tests recorded.

    report.py TABLE OUTPUT

TABLE has lines of operation, stress, error and bound with tabs between (see record.h); an operation may be `GROUP: WHAT`. Of
equal operation and stress the largest error counts. Fails where TABLE has nothing, or an error above its bound.
"""

import sys
from pathlib import Path

HEAD = """# Stability

The largest error of each operation under each kind of stress, made by `./run stress`: a relative error, the difference from a
twin in long double or double precision in units of the sum of the magnitudes that the result is made of (of alphas and
transmittances: of 1; of depths and means: of the value); values below the smallest normal float count as that. Each test says
what its unit is, and why its bound is what it is; half a step of a float is 6.0e-8.
"""


def read(path):
    """{group: {what: {stress: error}}} and {(group, what): bound}, in the order of their names."""
    errors, bounds = {}, {}
    for number, line in enumerate(path.read_text().splitlines(), 1):
        fields = line.split("\t")
        if len(fields) != 4:
            raise SystemExit(f"{path}:{number}: expected 4 fields, found {len(fields)}")
        operation, stress, error, bound = fields
        group, _, what = operation.partition(": ")
        found = errors.setdefault(group, {}).setdefault(what, {})
        found[stress] = max(found.get(stress, 0.0), float(error))
        bounds[group, what] = max(bounds.get((group, what), 0.0), float(bound))
    if not errors:
        raise SystemExit(f"{path}: expected errors, found none")
    return errors, bounds


def number(value):
    return "0" if value == 0 else f"{value:.1e}"


def row(cells):
    return "| " + " | ".join(cells) + " |\n"


def summary(errors, bounds):
    text = "\n" + row(["operation", "largest error", "bound", "under"]) + row(["---"] * 4)
    for group, whats in sorted(errors.items()):
        for what, found in sorted(whats.items()):
            stress = max(sorted(found), key=found.get)
            name = f"{group}: {what}" if what else group
            text += row([name, number(found[stress]), number(bounds[group, what]), stress if found[stress] else "all"])
    return text


def details(group, whats):
    names = sorted(whats)
    text = f"\n## {group[0].upper()}{group[1:]}\n\n" + row(["stress"] + [name or group for name in names])
    text += row(["---"] * (len(names) + 1))
    for stress in sorted({stress for found in whats.values() for stress in found}):
        text += row([stress] + [number(whats[name][stress]) if stress in whats[name] else "" for name in names])
    return text


def main():
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    errors, bounds = read(Path(sys.argv[1]))
    text = HEAD + summary(errors, bounds)
    for group, whats in sorted(errors.items()):
        text += details(group, whats)
    Path(sys.argv[2]).write_text(text)
    above = [
        f"{group}: {what}, {stress}: {number(error)}, expected at most {number(bounds[group, what])}"
        for group, whats in errors.items()
        for what, found in whats.items()
        for stress, error in found.items()
        if not error <= bounds[group, what]
    ]
    if above:
        raise SystemExit("\n".join(above))


if __name__ == "__main__":
    main()
