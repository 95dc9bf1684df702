"""Finds noisy frames and their references, and reads them.

A reference X.ref.exr belongs with every X.flat.exr and X.<spp>.flat.exr beside it, and with X.samples.exr and X.<spp>.samples.exr. The scene is the folder's name, or X
where that folder is the root of the data. Channels are named as in the project's convention (docs/channels.md).
"""

import hashlib
from collections import namedtuple
from pathlib import Path

from exr import read

# Never trained on: every figure that is published comes from these.
HELD_OUT = ("fur", "coffee", "living-room")

Pair = namedtuple("Pair", "noisy reference scene name")

NOISY, SAMPLES, REFERENCE = ".flat.exr", ".samples.exr", ".ref.exr"


def find(roots, kind=NOISY):
    """All pairs below the folders, in the order of their names, of flat frames or of samples. A pair is named by its path below its root."""
    pairs = []
    for root in map(Path, roots):
        for noisy in sorted(root.rglob("*" + kind)):
            view = noisy.name[: -len(kind)]
            head, _, last = view.rpartition(".")
            views = [view] + ([head] if last.isdigit() else [])
            for x in views:
                reference = noisy.with_name(x + REFERENCE)
                if reference.exists():
                    scene = x if noisy.parent == root else noisy.parent.name
                    name = str(noisy.relative_to(root))[: -len(kind)]
                    pairs.append(Pair(noisy, reference, scene, name))
                    break
    return pairs


def held_out(scene, share=0.0):
    """Whether a scene is kept from training: the three that always are, and a share of the others by their names."""
    if scene in HELD_OUT:
        return True
    number = int.from_bytes(hashlib.sha256(scene.encode()).digest()[:4], "big")
    return number < share * 2**32


def load(pair):
    """The channels of the noisy frame and of its reference; ValueError where they do not belong together."""
    noisy, spp = read(pair.noisy)
    reference, _ = read(pair.reference)
    for path, channels in ((pair.noisy, noisy), (pair.reference, reference)):
        for name in "RGB":
            if name not in channels:
                raise ValueError(f"{path}: channel {name}: expected one, found none")
    if noisy["R"].shape != reference["R"].shape:
        raise ValueError(f"{pair.noisy}: expected {reference['R'].shape} pixels, found {noisy['R'].shape}")
    return noisy, reference, spp
