"""A thin-lens camera with a square pixel grid."""
import math
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np


def unit(v):
    return np.asarray(v, float) / max(np.linalg.norm(v), 1e-12)


@dataclass
class Camera:
    origin: np.ndarray
    target: np.ndarray
    up: np.ndarray
    fov: float  # horizontal, degrees
    width: int
    height: int
    focus: float = 1.0  # distance along the axis
    blur: float = 0.0  # diameter in pixels of a far point's disc; 0: a pinhole

    @property
    def axes(self):
        """Right, up and forward, unit vectors."""
        forward = unit(np.subtract(self.target, self.origin))
        up = self.up if abs(np.dot(unit(self.up), forward)) < 0.999 else np.roll(self.up, 1)
        right = unit(np.cross(forward, up))
        return right, np.cross(right, forward), forward

    @property
    def scale(self):
        """The size in pixels of one unit at distance one."""
        return self.width / (2 * math.tan(math.radians(self.fov) / 2))

    def world_to_camera(self):
        """As OpenEXR stores it: x right, y up, z ahead, acting on row vectors."""
        m = np.eye(4, dtype=np.float32)
        m[:3, :3] = np.stack(self.axes, axis=1)
        m[3, :3] = -np.asarray(self.origin) @ m[:3, :3]
        return m

    def rays(self, pixel, lens):
        """Rays for continuous pixel coordinates and lens samples of [0, 1)^2. One kernel serves all cameras."""
        right, up, forward = (opaque3(a) for a in self.axes)
        f, s = opaque(self.focus), opaque(self.focus / self.scale)
        disk = mi.warp.square_to_uniform_disk_concentric(lens) * opaque(self.blur * self.focus / (2 * self.scale))
        shift = right * disk.x + up * disk.y
        at = forward * f + right * ((pixel.x - opaque(self.width / 2)) * s) - up * ((pixel.y - opaque(self.height / 2)) * s)
        ray = dr.zeros(mi.Ray3f, dr.width(pixel))
        ray.o = opaque3(self.origin) + shift
        ray.d = dr.normalize(at - shift)
        ray.maxt = dr.largest(mi.Float)
        return ray

    def depth(self, position):
        return dr.dot(position - opaque3(self.origin), opaque3(self.axes[2]))


def opaque(x):
    return dr.opaque(mi.Float, float(x))


def opaque3(v):
    return mi.Vector3f(*[opaque(x) for x in v])
