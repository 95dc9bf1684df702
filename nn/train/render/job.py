"""One job: a scene and some views of it, each a reference, two noisy frames and a file of samples. All follows from the job's index."""
import glob
import os
import time

import numpy as np
import OpenEXR

import deep
import frames
import random_scene
import shared_scene
from camera import Camera

SIZES = ((192, 144), (160, 160), (144, 192), (208, 128), (176, 152))
SPP = {2: 0.15, 4: 0.2, 8: 0.2, 16: 0.2, 32: 0.15, 64: 0.1}  # of the noisy frames, and how often
VIEWS = 3


class Unusable(Exception):
    """A scene or view that is not worth rendering; says why."""


def scene_of(index, scenes, hdri, kind=''):
    """(scene, camera proposals): two random scenes, then one of the made ones; of one kind, random ones alone."""
    rng = np.random.default_rng([7, index])
    if kind:
        scene, cameras, _ = random_scene.build(rng, sorted(glob.glob(os.path.join(hdri, '*.hdr'))), kind)
        return scene, cameras
    if index % 3 < 2 or not scenes:
        scene, cameras, kind = random_scene.build(rng, sorted(glob.glob(os.path.join(hdri, '*.hdr'))))
        return scene, cameras
    scene = shared_scene.load(os.path.join(scenes[index // 3 % len(scenes)], 'scene.xml'))
    shared_scene.vary(scene, rng)
    return scene, shared_scene.Cameras(scene)


def folder_of(index, scenes, kind=''):
    """The folder is the scene, by which training splits."""
    if kind:
        return f'{kind}.{index:05}'
    return f'random.{index:05}' if index % 3 < 2 or not scenes else os.path.basename(scenes[index // 3 % len(scenes)])


def probe(scene, camera, look):
    """A few paths over a coarse grid: light and depth of each, whether it hit, and how much there is to see: the mean step of the
    features from pixel to pixel."""
    small = Camera(camera.origin, camera.target, camera.up, camera.fov, camera.width // 4, camera.height // 4)
    v, hit = frames.samples(scene, small, look, 8, 99)
    features = v.mean(1)[:, 6:12].reshape(small.height, small.width, 6)
    detail = sum(np.abs(np.diff(features, axis=k)).mean() for k in (0, 1))
    return (v[..., 0:3] + v[..., 3:6]).mean(-1), v[..., 12], hit, detail


def compose(rng, scene, cameras):
    """A camera that sees something, focused and exposed, and its Look: of two to five that will do, the one that sees most."""
    width, height = SIZES[rng.integers(len(SIZES))]
    look = frames.Look(clamp=np.inf, depth=int(rng.integers(4, 11)), background=float(rng.random() < 0.35))
    wanted, found = int(rng.integers(2, 6)), []
    for _ in range(12):
        camera = Camera(*cameras(rng), width, height)
        light, z, hit, detail = probe(scene, camera, look)
        if hit.mean() < 0.45 or np.quantile(z[hit], 0.1) < 0.08 * np.median(z[hit]) or (light.mean(1) > 0).mean() < 0.2:
            continue
        level = np.minimum(light, np.quantile(light, 0.98)).mean()
        found += [(detail, camera, level, z[hit])] if level > 0 else []
        if len(found) == wanted:
            break
    if not found:
        raise Unusable('no camera sees enough')
    _, camera, level, z = max(found, key=lambda f: f[0])
    camera.focus = float(np.quantile(z, rng.uniform(0.05, 0.9)))
    camera.blur = 0.0 if rng.random() < 0.15 else float(np.exp(rng.uniform(np.log(1.5), np.log(20))))
    look.exposure = float(np.exp(rng.uniform(np.log(0.12), np.log(0.45))) / level)
    look.clamp = 20.0
    return camera, look


def same_camera(path, camera):
    """Whether an image was seen by this camera."""
    header = OpenEXR.File(path, header_only=True).header()
    return np.allclose(header['worldToCamera'], camera.world_to_camera(), 1e-4, 1e-4) and np.isclose(header['fathom:ppuScale'], camera.scale)


def complete(path, kept, only_samples):
    return os.path.exists(f'{path}.{kept}.samples.exr') and (only_samples or os.path.exists(path + '.ref.exr'))


def view(rng, scene, cameras, path, kept):
    """Write what is not there of path.KEPT.samples.exr, two path.SPP.flat.exr and, last, path.ref.exr."""
    start = time.time()
    camera, look = compose(rng, scene, cameras)
    counts = rng.choice(list(SPP), 2, replace=False, p=list(SPP.values()))
    seed = int(rng.integers(1 << 30))
    reference, samples, made = path + '.ref.exr', f'{path}.{kept}.samples.exr', []
    if os.path.exists(reference):
        if not same_camera(reference, camera):
            raise Unusable('its reference has another camera')
    else:
        channels, spp = frames.reference(scene, camera, look, 256, seed, enough=0.003)
        light = (channels['R'] + channels['G'] + channels['B']) / 3
        dark = (light < 0.002).mean()
        if channels['A'].mean() < 0.3 or dark > 0.7:
            raise Unusable(f'{1 - channels["A"].mean():.2f} of it is empty, {dark:.2f} dark')
        for k, count in enumerate(counts):
            frames.write(f'{path}.{count}.flat.exr', camera, int(count), frames.noisy(scene, camera, look, int(count), seed + 1000 * (k + 1)))
        made = [f'noisy {counts[0]} and {counts[1]}', f'reference {spp}']
    if not os.path.exists(samples):
        deep.write(samples, camera, *frames.samples(scene, camera, look, kept, seed + 5000))
        made = [f'samples {kept}', *made]
    if not os.path.exists(reference):
        frames.write(reference, camera, spp, channels)
    print(f'{path}: {camera.width}x{camera.height}, {", ".join(made)}, {time.time() - start:.1f} s', flush=True)


def run(index, out, scenes, hdri, kind='', kept=64, only_samples=False):
    """All views of a job, with files of `kept` camera samples per pixel; with `only_samples` the samples alone, of views that have a reference."""
    folder = os.path.join(out, folder_of(index, scenes, kind))
    paths = [os.path.join(folder, f'{index:05}-{k}') for k in range(VIEWS)]
    wanted = [k for k, p in enumerate(paths) if not complete(p, kept, only_samples) and (not only_samples or os.path.exists(p + '.ref.exr'))]
    if not wanted:
        return
    scene, cameras = scene_of(index, scenes, hdri, kind)
    os.makedirs(folder, exist_ok=True)
    for k in wanted:
        try:
            view(np.random.default_rng([11, index, k]), scene, cameras, paths[k], kept)
        except Unusable as why:
            print(f'{paths[k]}: skipped: {why}', flush=True)
