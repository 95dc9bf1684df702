"""Made scenes from a folder of scene.xml files, with varied materials, lights and cameras."""
import os
import re

import drjit as dr
import mitsuba as mi
import numpy as np
from PIL import Image

import textures
from camera import unit

HELD_OUT = ('fur', 'coffee', 'living-room')  # the frames that models are judged by


LAMP = ('<shape type="rectangle"><transform name="to_world"><scale x="0.6" y="0.1" z="1"/><rotate x="1" angle="90"/>'
        '<translate x="%d" y="2.75" z="%d"/></transform><emitter type="area"><rgb name="radiance" value="12, 11, 10"/></emitter></shape>')
MENDS = {  # what does not load or gives no light, by scene: pattern, replacement
    'classroom': (r'<emitter type="sunsky" >.*?</emitter>', ''.join(LAMP % at for at in ((-2, -3), (2, -3), (-2, 1), (2, 1)))),
    'material-testball': (r'<bsdf type="coating" >.*?(<ref id="RoughMetal" />)\s*</bsdf>', r'\1'),
    'living-room-3': (r'<shape type="hair" >.*?</shape>', ''),
}


def load(path):
    """A scene's surfaces and lights: without media, and without what only other releases of the renderer know."""
    text = re.sub(r'<!--.*?-->', '', open(path).read(), flags=re.S)
    name = os.path.basename(os.path.dirname(os.path.abspath(path)))
    text = re.sub(*MENDS.get(name, ('$^', '')), text, flags=re.S)
    text = re.sub(r'<(sampler|integrator|film|medium)\b[^>]*?(?:/>|>.*?</\1>)', '', text, flags=re.S)
    text = re.sub(r'</integrator>|<ref (?:name="(?:interior|exterior|sampler)"|id="(?:medium|sampler|film)")[^>]*/>', '', text)
    for old, new in (('<lookAt', '<lookat'), ('value="trilinear"', 'value="bilinear"'), ('value="ewa"', 'value="bilinear"')):
        text = text.replace(old, new)
    mi.file_resolver().prepend(os.path.dirname(os.path.abspath(path)))
    config = mi.parser.ParserConfig(mi.variant())
    config.unused_properties = mi.LogLevel.Debug
    state = mi.parser.parse_string(config, text)
    mi.parser.transform_all(config, state)
    made = mi.parser.instantiate(config, state)
    return made[0] if isinstance(made, (list, tuple)) else made


def recoloured(old, rng):
    """A picture parameter (bytes or floats, any channels) tinted, or replaced by a pattern."""
    a = np.array(old)
    top = 255 if a.dtype == np.uint8 else 1
    if rng.random() < 0.3:
        new = np.asarray(Image.fromarray((textures.picture(rng) * 255).astype(np.uint8)).resize(a.shape[1::-1]))[..., :a.shape[2]] / 255 * top
    else:
        new = a * rng.uniform(0.4, 1.1, a.shape[2])
    return type(old)(np.ascontiguousarray(np.clip(new, 0, top).astype(a.dtype)))


def like(old, colour):
    """A colour as the type of the parameter that it replaces."""
    return mi.Color3f(*map(float, colour)) if isinstance(old, mi.Color3f) else float(np.mean(colour))


def vary(scene, rng):
    """Recolour materials, change roughness, swap some pictures, scale and tint lights."""
    p = mi.traverse(scene)
    strength = rng.choice([0.0, 0.3, 1.0], p=[0.3, 0.4, 0.3])
    for key in list(p.keys()):
        if key.endswith('radiance.value'):
            p[key] = p[key] * mi.Color3f(*map(float, np.exp(rng.normal() * 0.8) * rng.uniform(0.6, 1.2, 3)))
        elif rng.random() > strength:
            continue
        elif key.endswith('specular_reflectance.value'):
            p[key] = like(p[key], rng.uniform(0.3, 1) ** rng.uniform(0.5, 1.5, 3))
        elif key.endswith(('reflectance.value', 'base_color.value')):
            p[key] = like(p[key], textures.colour(rng))
        elif key.endswith('reflectance.data'):
            p[key] = recoloured(p[key], rng)
        elif key.endswith(('alpha.value', '.alpha', 'roughness.value')):
            p[key] = float(np.clip(np.array(p[key]).ravel()[0] * np.exp(rng.normal() * 0.7), 0.01, 0.8))
    p.update()


class Cameras:
    """Views of what the scene's own camera sees: it moves aside or nearer, never through a surface, and looks elsewhere."""
    def __init__(self, scene):
        sensor = scene.sensors()[0]
        p = mi.traverse(sensor)
        m = np.array(p['to_world'].matrix, dtype=float).reshape(4, 4, -1)[..., 0]
        self.scene, self.origin, self.forward, self.up = scene, m[:3, 3], unit(m[:3, 2]), unit(m[:3, 1])
        self.fov = float(np.array(next(p[k] for k in p.keys() if k.endswith('x_fov'))).ravel()[0])
        side, t = np.cross(self.forward, self.up), np.tan(np.radians(self.fov / 2))
        x, y = np.meshgrid(np.linspace(-t, t, 16), np.linspace(-t, t, 16) * 0.6)
        ways = self.forward + x.reshape(-1, 1) * side + y.reshape(-1, 1) * self.up
        self.points, valid = self.meet(self.origin, ways / np.linalg.norm(ways, axis=1, keepdims=True))
        self.points = self.points[valid]

    def meet(self, origin, ways):
        """Where rays first meet a surface, and whether they do."""
        o = mi.Point3f(*[dr.opaque(mi.Float, float(x)) for x in origin])
        si = self.scene.ray_intersect(mi.Ray3f(o, mi.Vector3f(*[mi.Float(w.astype(np.float32)) for w in ways.T])))
        return np.array(si.p).T, np.array(si.is_valid())

    def free(self, to):
        """Whether the straight way from the scene's camera is clear, with a margin."""
        way = np.subtract(to, self.origin)
        hit, valid = self.meet(self.origin, unit(way)[None])
        return not valid[0] or np.linalg.norm(hit[0] - self.origin) > 1.15 * np.linalg.norm(way)

    def __call__(self, rng):
        fov = np.clip(self.fov * rng.uniform(0.5, 1.15), 15, 85)
        if len(self.points) == 0:
            return self.origin, self.origin + self.forward, self.up, fov
        near, look = self.points[rng.integers(len(self.points), size=2)]
        reach = np.median(np.linalg.norm(self.points - self.origin, axis=1))
        for k in range(8):
            jitter = rng.normal(size=3) * 0.2 * reach / (1 + k)
            origin = self.origin + rng.uniform(0, 0.6) * (near - self.origin) / (1 + 0.5 * k) + jitter
            if self.free(origin):
                return origin, look, self.up, fov
        return self.origin, look, self.up, fov
