#!/usr/bin/env python3
"""Laws of the training renders. Needs what render.py needs; takes about a minute."""
import contextlib
import glob
import io
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

os.environ.setdefault('DRJIT_LIBLLVM_PATH', next(iter(glob.glob('/usr/lib/*/libLLVM-19.so')), ''))
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import mitsuba as mi
import numpy as np
import OpenEXR

mi.set_variant('llvm_ad_rgb')
import deep
import frames
import job
import meshes
import random_scene
import render
import shared_scene
from camera import Camera

LIGHT = {'type': 'constant', 'radiance': {'type': 'rgb', 'value': 0.5}}


def ball(bsdf):
    """A ball that more than fills the view, in even light of 0.5, and its camera."""
    shape = meshes.shape(meshes.sphere(), bsdf=mi.load_dict(bsdf))
    return mi.load_dict({'type': 'scene', 'ball': shape, 'light': LIGHT}), Camera((0, -2, 0), (0, 0, 0), (0, 0, 1), 10, 16, 12, focus=1.5, blur=2)


def grey(value):
    return {'type': 'diffuse', 'reflectance': {'type': 'rgb', 'value': value}}


def planes(channels, *names):
    return np.stack([channels[n] for n in names], axis=-1)


class Tracing(unittest.TestCase):
    def test_a_convex_diffuse_body_in_even_light_is_albedo_times_light(self):
        scene, camera = ball({'type': 'twosided', 'nested': grey(0.6)})
        c, _ = frames.reference(scene, camera, frames.Look(), 64, 1)
        self.assertAlmostEqual(c['R'].mean(), 0.3, delta=0.002)
        np.testing.assert_allclose(c['albedo.G'], 0.6, rtol=1e-4)
        np.testing.assert_allclose(c['specular.R'], 0, atol=1e-6)

    def test_a_mirror_has_no_diffuse_light(self):
        scene, camera = ball({'type': 'conductor', 'material': 'none'})
        c, _ = frames.reference(scene, camera, frames.Look(), 16, 1)
        np.testing.assert_allclose(c['diffuse.R'], 0, atol=1e-6)
        np.testing.assert_allclose(c['specular.R'], 0.5, rtol=1e-3)

    def test_a_half_open_mask_passes_half_the_light(self):
        scene, camera = ball({'type': 'mask', 'opacity': 0.5, 'nested': {'type': 'twosided', 'nested': grey(1.0)}})
        for background in (0.0, 1.0):  # both walls of the ball are passed by a quarter of the paths
            c, _ = frames.reference(scene, camera, frames.Look(depth=40, background=background), 256, 1)
            self.assertAlmostEqual(c['A'].mean(), 0.75, delta=0.02)
            self.assertAlmostEqual(c['R'].mean(), 0.375 + 0.125 * background, delta=0.01)

    def test_light_that_comes_through_a_mask_counts_in_full(self):
        _, camera = ball(grey(0.6))
        veil = {'type': 'mask', 'opacity': 0.5, 'nested': {'type': 'twosided', 'nested': grey(0.0)}}
        inside = meshes.shape(meshes.sphere(), bsdf=mi.load_dict({'type': 'twosided', 'nested': grey(0.6)}))
        around = meshes.shape(meshes.sphere().moved(2.0), bsdf=mi.load_dict(veil))
        scene = mi.load_dict({'type': 'scene', 'inside': inside, 'around': around, 'light': LIGHT})
        c, _ = frames.reference(scene, camera, frames.Look(), 256, 1)
        self.assertAlmostEqual(c['R'].mean(), 0.5 * 0.5 * 0.5 * 0.6, delta=0.003)

    def test_depth_is_along_the_axis_and_the_picture_is_not_mirrored(self):
        card = meshes.shape(meshes.plane().moved(rotation=[[1, 0, 0], [0, 0, -1], [0, 1, 0]], to=(0.5, 3, 0.5)), bsdf=mi.load_dict(grey(0.5)))
        scene = mi.load_dict({'type': 'scene', 'card': card, 'light': LIGHT})
        camera = Camera((0, 0, 0), (0, 3, 0), (0, 0, 1), 50, 16, 16)
        c, _ = frames.reference(scene, camera, frames.Look(), 16, 1)
        a, z = c['A'].reshape(16, 16), c['Z'].reshape(16, 16)
        self.assertEqual(a[:8, 8:].mean() > 0, True)  # x to the right, z up
        self.assertEqual(a[8:].sum() + a[:, :8].sum(), 0)
        np.testing.assert_allclose(z[a > 0], 3, rtol=1e-5)
        np.testing.assert_allclose(np.array([0.5, 3, 0.5, 1]) @ camera.world_to_camera(), [0.5, 0.5, 3, 1], atol=1e-6)


class Frames(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scene, cameras, _ = random_scene.build(np.random.default_rng(3), [])
        cls.camera, cls.look = job.compose(np.random.default_rng(4), cls.scene, cameras)
        cls.camera.width, cls.camera.height = 32, 24

    def test_noisy_frames_agree_with_the_reference_within_their_variance(self):
        reference, spp = frames.reference(self.scene, self.camera, self.look, 512, 1)
        self.assertEqual(spp, 512)
        noisy = frames.noisy(self.scene, self.camera, self.look, 64, 900)
        for names in (('R', 'G', 'B'), ('diffuse.R', 'diffuse.G', 'diffuse.B')):
            variances = ['variance.' + n for n in names]
            variance = planes(noisy, *variances) + planes(reference, *variances)
            error = planes(noisy, *names) - planes(reference, *names)
            self.assertLess(abs(error.mean()) / np.sqrt(variance.sum()) * error.size, 4 * 3 ** 0.5)  # the colours are correlated
            self.assertAlmostEqual((error ** 2).mean() / variance.mean(), 1, delta=0.5)

    def test_halves_and_components_add_up(self):
        c = frames.noisy(self.scene, self.camera, self.look, 4, 7)
        for n in ('R', 'diffuse.G', 'albedo.B'):
            np.testing.assert_allclose((c['half0.' + n] + c['half1.' + n]) / 2, c[n], atol=1e-5)
        np.testing.assert_allclose(c['R'], c['diffuse.R'] + c['specular.R'], atol=1e-5)
        self.assertLessEqual(c['R'].max(), self.look.clamp * 1.001)


class Samples(unittest.TestCase):
    def test_samples_flatten_to_the_mean_of_all_paths_and_depths_ascend(self):
        rng = np.random.default_rng(1)
        v, camera = rng.random((8, 15)), Camera((0, 0, 0), (0, 1, 0), (0, 0, 1), 40, 16, 12, focus=1.5, blur=6)
        v[:, 12] = [3, 2, 2, 2, 5, 0, 4, 0]
        hit = v[:, 12] > 0
        out = deep.pixel(v[hit], 8, camera)
        self.assertTrue((np.diff(out['Z']) > 0).all())
        np.testing.assert_allclose(out['Z'], [2, 2, 2, 3, 4, 5], rtol=1e-6)
        np.testing.assert_allclose(out['coc'], 6 * np.abs(1 - 1.5 / out['Z']), rtol=1e-3)
        passed = np.cumprod(1 - np.append(0, out['A'][:-1]))
        np.testing.assert_allclose(passed * out['A'], 1 / 8, rtol=1e-6)
        for k, name in enumerate(('diffuse.R', 'diffuse.G', 'diffuse.B', 'specular.R')):
            self.assertAlmostEqual((passed * out[name]).sum(), v[hit, k].sum() / 8, places=3)
        self.assertAlmostEqual((passed * out['B']).sum(), (v[hit, 2] + v[hit, 5]).sum() / 8, places=3)
        self.assertEqual(len(deep.pixel(v[:0], 8, camera)['Z']), 0)

    def test_samples_of_a_view_agree_with_its_reference(self):
        scene, camera = ball({'type': 'twosided', 'nested': grey(0.6)})
        v, hit = frames.samples(scene, camera, frames.Look(), 8, 5)
        self.assertEqual(v.shape, (16 * 12, 8, 15))
        self.assertAlmostEqual((v[..., 0] + v[..., 3]).mean(), 0.3, delta=0.01)
        self.assertTrue((v[..., 13:] >= 0).all() and (v[..., 13:] < 1).all() and hit.all())


class Batches(unittest.TestCase):
    def test_a_job_is_repeatable_and_not_done_twice(self):
        job.SIZES, job.SPP, job.VIEWS = ((64, 64),), {2: 0.5, 4: 0.5}, 1
        with tempfile.TemporaryDirectory() as a, tempfile.TemporaryDirectory() as b, contextlib.redirect_stdout(io.StringIO()):
            for folder in (a, b):
                job.run(0, folder, [], '', kept=8)
            names = sorted(os.listdir(os.path.join(a, 'random.00000')))
            self.assertEqual(names, ['00000-0.2.flat.exr', '00000-0.4.flat.exr', '00000-0.8.samples.exr', '00000-0.ref.exr'])
            flat = lambda x: np.concatenate([p for p in x.ravel() if p is not None]) if x.dtype == object else x
            read = lambda folder, n: {k: flat(c.pixels) for k, c in OpenEXR.File(os.path.join(folder, 'random.00000', n), separate_channels=True).channels().items()}
            for n in names:
                one, two = read(a, n), read(b, n)
                self.assertTrue(all(np.array_equal(one[k], two[k]) for k in one | two))
            before = [os.stat(os.path.join(a, 'random.00000', n)).st_mtime_ns for n in names]
            job.run(0, a, [], '', kept=8)
            self.assertEqual(before, [os.stat(os.path.join(a, 'random.00000', n)).st_mtime_ns for n in names])
            samples = os.path.join(a, 'random.00000', names[2])
            os.remove(samples)
            job.run(0, a, [], '', kept=8, only_samples=True)
            one, two = read(a, names[2]), read(b, names[2])
            self.assertTrue(all(np.array_equal(one[k], two[k]) for k in one | two))
            job.run(1, a, [], '', kept=8, only_samples=True)
            self.assertFalse(os.path.exists(os.path.join(a, 'random.00001')))

    def test_a_broken_scene_is_skipped_with_a_line_and_held_out_ones_are_never_read(self):
        with tempfile.TemporaryDirectory() as folder:
            for name in ('broken', *shared_scene.HELD_OUT):
                os.mkdir(os.path.join(folder, name))
                pathlib.Path(folder, name, 'scene.xml').write_text('<scene version="3.0.0"><shape type="none"/></scene>')
            self.assertEqual([os.path.basename(s) for s in render.made_scenes(folder)], ['broken'])
            out = subprocess.run([sys.executable, render.__file__, os.path.join(folder, 'out'), '--hdri', folder, '--scenes', folder, '--jobs', '2:3'],
                                 capture_output=True, text=True, check=True).stdout
            self.assertIn('job 2: skipped: ', out)


if __name__ == '__main__':
    unittest.main()
