"""Triangle meshes for random scenes: (vertices, faces, texture coordinates, smooth), about one unit in size, z up."""
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np


@dataclass
class Mesh:
    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray
    smooth: bool = True

    def moved(self, scale=1.0, rotation=np.eye(3), to=(0, 0, 0)):
        return Mesh((self.vertices * scale) @ np.asarray(rotation).T + np.asarray(to), self.faces, self.uv, self.smooth)

    def on_ground(self):
        return self.moved(to=(0, 0, -self.vertices[:, 2].min()))


def merged(meshes):
    start = np.cumsum([0] + [len(m.vertices) for m in meshes])
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate([m.faces + s for m, s in zip(meshes, start)]),
                np.concatenate([m.uv for m in meshes]), meshes[0].smooth)


def shape(mesh, **plugins):
    """The renderer's shape, with its bsdf and emitter."""
    props = mi.Properties()
    for name, plugin in plugins.items():
        props[name] = plugin
    out = mi.Mesh('mesh', len(mesh.vertices), len(mesh.faces), props=props, has_vertex_normals=mesh.smooth, has_vertex_texcoords=True)
    p = mi.traverse(out)
    p['faces'] = mi.UInt32(mesh.faces.astype(np.uint32).ravel())
    p['vertex_texcoords'] = mi.Float(mesh.uv.astype(np.float32).ravel())
    p['vertex_positions'] = mi.Float(mesh.vertices.astype(np.float32).ravel())
    p.update()
    return out


def rotation(rng, tilt=np.pi):
    """About the vertical by any angle, then about a level axis by up to `tilt`."""
    a, b, t = rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi), rng.uniform(-tilt, tilt)
    about_z = lambda x: np.array([[np.cos(x), -np.sin(x), 0], [np.sin(x), np.cos(x), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(t), -np.sin(t)], [0, np.sin(t), np.cos(t)]])
    return about_z(b) @ about_x @ about_z(a)


def grid(f, n, m, wrap=False, smooth=True):
    """The surface f(u, v) -> (..., 3) over n by m cells of [0, 1]^2; `wrap` closes it along u."""
    u, v = np.meshgrid(np.linspace(0, 1, n + 1)[:n + 1 - wrap], np.linspace(0, 1, m + 1), indexing='ij')
    i, j = np.meshgrid(np.arange(n), np.arange(m), indexing='ij')
    at = lambda a, b: ((a % len(u)) * (m + 1) + b).ravel()
    a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return Mesh(np.asarray(f(u, v)).reshape(-1, 3), faces, np.stack([u, v], -1).reshape(-1, 2), smooth)


def plane():
    return grid(lambda u, v: np.stack([u - 0.5, v - 0.5, 0 * u], -1), 1, 1, smooth=False)


def box():
    face = plane().moved(to=(0, 0, 0.5))
    x, y = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    return merged([face.moved(rotation=r) for r in (np.eye(3), x, x @ x, x.T, y, y.T)])


def superquadric(rng, roundness=None):
    """Ellipsoids, rounded boxes and cylinders, pinched stars."""
    e, g = roundness or (rng.choice([0.15, 0.4, 1, 1, 1, 2]), rng.choice([0.15, 0.4, 1, 1, 1, 2]))
    power = lambda x, p: np.sign(x) * np.abs(x) ** p
    def f(u, v):
        a, b = (2 * u - 1) * np.pi, (v - 0.5) * np.pi
        return 0.5 * np.stack([power(np.cos(b), e) * power(np.cos(a), g), power(np.cos(b), e) * power(np.sin(a), g), power(np.sin(b), e)], -1)
    return grid(f, 64, 32, wrap=True)


def sphere():
    return superquadric(None, (1, 1))


def cylinder():
    side = grid(lambda u, v: np.stack([0.5 * np.cos(2 * np.pi * u), 0.5 * np.sin(2 * np.pi * u), v - 0.5], -1), 48, 1, wrap=True)
    caps = [disk().moved(to=(0, 0, 0.5)), disk().moved(rotation=np.diag([1, -1, -1]), to=(0, 0, -0.5))]
    return merged([side] + caps)


def disk():
    return grid(lambda u, v: 0.5 * np.stack([v * np.cos(2 * np.pi * u), v * np.sin(2 * np.pi * u), 0 * u], -1), 48, 2, wrap=True)


def lathe(rng):
    """A vase: a smooth random profile turned about the vertical."""
    knots = rng.uniform(0.1, 0.5, 6)
    def f(u, v):
        r = np.interp(v, np.linspace(0, 1, 60), smooth_curve(knots[:, None], 60)[:, 0])
        return np.stack([r * np.cos(2 * np.pi * u), r * np.sin(2 * np.pi * u), v - 0.5], -1)
    return grid(f, 48, 48, wrap=True)


def smooth_curve(knots, n):
    """n points of a uniform quadratic B-spline over knots (k, c)."""
    t = np.linspace(0, len(knots) - 2 - 1e-6, n)
    i, x = t.astype(int), (t % 1)[:, None]
    return 0.5 * (1 - x) ** 2 * knots[i] + (0.5 + x - x * x) * knots[i + 1] + 0.5 * x * x * knots[i + 2]


def tube(points, radius, sides=8):
    """Around a polyline (n, 3); radius: one, or one per point."""
    n = len(points)
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True) + 1e-9
    a = np.cross(tangent, tangent[:, [1, 2, 0]] + [0.3, -0.2, 0.1])
    a /= np.linalg.norm(a, axis=1, keepdims=True) + 1e-9
    b = np.cross(tangent, a)
    r = np.broadcast_to(radius, n)[:, None]
    def f(u, v):
        k = np.rint(v * (n - 1)).astype(int)
        return points[k] + r[k] * (np.cos(2 * np.pi * u)[..., None] * a[k] + np.sin(2 * np.pi * u)[..., None] * b[k])
    return grid(f, sides, n - 1, wrap=True)


def wire(rng):
    """One bent pipe."""
    return tube(smooth_curve(rng.uniform(-0.6, 0.6, (rng.integers(4, 9), 3)), 80), rng.uniform(0.015, 0.08), 12)


def torus(rng):
    t = np.linspace(0, 2 * np.pi, 65)
    return tube(np.stack([0.4 * np.cos(t), 0.4 * np.sin(t), rng.uniform(0, 0.15) * np.sin(rng.integers(1, 4) * t)], -1), rng.uniform(0.04, 0.15), 20)


def tuft(rng, count=None):
    """Grass or thick hair: tapering bent blades from a disc or a ball."""
    count = count or int(rng.integers(80, 900))
    length, width, bend = rng.uniform(0.2, 0.9), rng.uniform(0.002, 0.012), rng.uniform(0.05, 0.6)
    ball = rng.random() < 0.4
    blades = []
    for _ in range(count):
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        root = 0.3 * way if ball else np.array([*rng.uniform(-0.5, 0.5, 2), 0.0])
        way = way if ball else np.array([0, 0, 1.0])
        t = np.linspace(0, 1, 6)[:, None]
        points = root + length * rng.uniform(0.5, 1) * (way * t + bend * rng.normal(size=3) * t * t)
        blades.append(tube(points, width * np.linspace(1, 0.25, 6), 4))
    return merged(blades)


def rooted(rng, mesh, count):
    """`count` random points of a surface, and its normals there."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    face = rng.choice(len(areas), count, p=areas / areas.sum())
    a, b = np.sqrt(rng.random(count))[:, None], rng.random(count)[:, None]
    points = np.einsum('nk,nkc->nc', np.concatenate([1 - a, a * (1 - b), a * b], 1), corners[face])
    return points, normals[face] / areas[face, None]


def pelt(rng, mesh):
    """Short fur to long hair on a closed surface of about one unit: thin ribbons, combed in places, finer than pixels mostly."""
    count, joints = int(np.exp(rng.uniform(np.log(4e3), np.log(3e4)))), 5
    roots, out = rooted(rng, mesh, count)
    out *= np.sign(np.sum(out * (roots - mesh.vertices.mean(0)), 1, keepdims=True) + 1e-9)
    combed = np.stack([waves(rng)(2 * roots) for _ in range(3)], 1) * rng.uniform(0.2, 1.2)
    length = np.exp(rng.uniform(np.log(0.04), np.log(0.5))) * rng.uniform(0.6, 1, (count, 1))
    bend = combed + rng.uniform(0.05, 0.5) * rng.normal(size=(count, 3)) + [0, 0, -rng.uniform(0, 0.6)]
    t = np.linspace(0, 1, joints)[:, None, None]
    middle = roots + length * (out * t + bend * t * t)  # (joints, count, 3)
    across = np.cross(out + 0.3 * rng.normal(size=(count, 3)), bend + 0.3 * rng.normal(size=(count, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True) + 1e-9
    half = 0.5 * np.exp(rng.uniform(np.log(0.001), np.log(0.008))) * (1 - 0.8 * t) * across
    vertices = np.stack([middle - half, middle + half], 2).transpose(1, 0, 2, 3).reshape(-1, 3)
    first = (2 * joints * np.arange(count)[:, None] + 2 * np.arange(joints - 1)).reshape(-1, 1)
    faces = np.concatenate([first + [0, 1, 2], first + [2, 1, 3]])
    shade = np.repeat(rng.random(count), 2 * joints)
    uv = np.stack([shade, np.tile(np.repeat(np.linspace(0, 1, joints), 2), count)], 1)
    return Mesh(vertices, faces, uv, smooth=False)


def fence(rng):
    """Upright bars with rails, a lattice, or slats."""
    n, thin = int(rng.integers(5, 24)), rng.uniform(0.004, 0.03)
    bar = box() if rng.random() < 0.5 else cylinder()
    across = [bar.moved(scale=(thin, thin, 1), to=(x, 0, 0)) for x in np.linspace(-0.8, 0.8, n)]
    lie = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    rails = [bar.moved(scale=(thin, thin, 1.6), rotation=lie, to=(0, 0, z)) for z in np.linspace(-0.45, 0.45, int(rng.integers(2, n)))]
    out = merged(across + rails)
    out.smooth = False
    return out


def cards(rng):
    """Foliage or confetti: small flat leaves, any way round, in a ball."""
    leaf, size = plane(), rng.uniform(0.03, 0.15)
    out = [leaf.moved(size * rng.uniform(0.5, 1), rotation(rng), rng.normal(size=3) * 0.22) for _ in range(int(rng.integers(40, 400)))]
    return merged(out)


def stack(rng):
    """Parallel sheets with gaps, such as shelves or louvres."""
    n = int(rng.integers(3, 12))
    return merged([box().moved(scale=(1, rng.uniform(0.5, 1), 0.01 + 0.3 / n * rng.random()), to=(0, 0, z)) for z in np.linspace(-0.5, 0.5, n)])


def waves(rng, n=8):
    """A sum of random plane waves: f(points (..., d)) of about [-1, 1]."""
    def f(p):
        total = 0
        for k in range(n):
            way = directions[k][:p.shape[-1]]
            total = total + np.sin(p @ way * 2 ** (k * 0.5) * 3 + phases[k]) / 2 ** (k * 0.5)
        return total / 2
    directions, phases = rng.normal(size=(n, 3)), rng.uniform(0, 7, n)
    return f


def blob(rng):
    """A ball with bumps."""
    out, f = sphere(), waves(rng)
    out.vertices = out.vertices * (1 + rng.uniform(0.05, 0.3) * f(3 * out.vertices))[:, None]
    return out


def terrain(rng, size, height):
    f = waves(rng)
    def at(u, v):
        p = np.stack([u - 0.5, v - 0.5], -1)
        return np.concatenate([p * size, height * f(4 * p)[..., None]], -1)
    return grid(at, 128, 128)


def anything(rng):
    solid = [superquadric, superquadric, lathe, torus, blob, lambda r: sphere(), lambda r: box(), lambda r: box(), lambda r: cylinder()]
    fine = [wire, tuft, fence, cards, stack, lambda r: disk()]
    return rng.choice(solid if rng.random() < 0.68 else fine)(rng)
