"""Procedural pictures for random scenes: (height, width, 3) or (height, width) arrays in [0, 1]."""
import numpy as np
from PIL import Image, ImageDraw, ImageFont


def colour(rng, low=0.04, high=0.9):
    """A plausible reflectance: often muted, sometimes vivid, sometimes grey."""
    hue, value = rng.random(), np.exp(rng.uniform(np.log(low), np.log(high)))
    saturation = rng.choice([0.0, rng.uniform(0, 0.35), rng.uniform(0.3, 0.8), rng.uniform(0.8, 1)], p=[0.15, 0.4, 0.3, 0.15])
    vivid = np.clip(np.abs((hue * 6 + np.array([0, 4, 2])) % 6 - 3) - 1, 0, 1)
    return value * (1 - saturation + saturation * vivid)


def fractal(rng, size, octaves=6, lowest=2, stretch=1):
    """Value noise, octaves halving, [0, 1]."""
    total = np.zeros((size, size))
    for k in range(octaves):
        n = lowest * 2 ** k
        if n > size:
            break
        small = Image.fromarray(rng.random((max(2, n // stretch), n)).astype(np.float32))
        total += np.asarray(small.resize((size, size), Image.BICUBIC)) * rng.uniform(0.4, 0.7) ** k
    return (total - total.min()) / (np.ptp(total) + 1e-9)


def coordinates(size):
    return np.meshgrid(np.linspace(0, 1, size, endpoint=False), np.linspace(0, 1, size, endpoint=False))


def checker(rng, size):
    x, y = coordinates(size)
    n = rng.integers(2, 20)
    return ((x * n).astype(int) + (y * n).astype(int)) % 2


def stripes(rng, size):
    x, y = coordinates(size)
    a, n, w = rng.uniform(0, np.pi), rng.integers(3, 40), rng.uniform(0.15, 0.85)
    return ((np.cos(a) * x + np.sin(a) * y) * n % 1 < w) * 1.0


def plaid(rng, size):
    return 0.5 * (stripes(rng, size) + stripes(rng, size))


def dots(rng, size):
    x, y = coordinates(size)
    n = rng.integers(3, 24)
    return (np.hypot(x * n % 1 - 0.5, y * n % 1 - 0.5) < rng.uniform(0.15, 0.48)) * 1.0


def bricks(rng, size):
    x, y = coordinates(size)
    n, gap = rng.integers(4, 16), rng.uniform(0.03, 0.12)
    row = (y * n).astype(int)
    u = x * n / 2 + 0.5 * (row % 2)
    wall = ((u % 1 > gap / 2) & (y * n % 1 > gap)) * 1.0
    shade = rng.random((n, n + 2))[row, u.astype(int) % n]
    return wall * (0.5 + 0.5 * shade)


def wood(rng, size):
    x, y = coordinates(size)
    bend = fractal(rng, size, 4, 2) * rng.uniform(0.05, 0.3)
    rings = (np.hypot(x - 0.5 + bend, 0.15 * y) * rng.uniform(6, 30)) % 1
    return 0.7 * rings + 0.3 * fractal(rng, size, 5, 32, 16)


def cells(rng, size):
    """Voronoi cells of their own shades, or the distance to their centres."""
    n = int(rng.integers(10, 120))
    p = rng.random((n, 2))
    x, y = coordinates(size)
    best, which = np.full((size, size), 9.0), np.zeros((size, size), int)
    for k in range(n):
        d = np.hypot(x - p[k, 0], y - p[k, 1])
        which = np.where(d < best, k, which)
        best = np.minimum(best, d)
    return rng.random(n)[which] if rng.random() < 0.6 else best / best.max()


def text(rng, size):
    """Lines of letters, as on labels and pages."""
    image = Image.new('L', (size, size), 0)
    draw, y = ImageDraw.Draw(image), 4
    letters = list('abcdefghijklmnopqrstuvwxyzABCDEFGHKLMNRSTXZ0123456789 .,-   ')
    while y < size:
        height = int(rng.integers(8, 48))
        draw.text((int(rng.integers(0, 30)), y), ''.join(rng.choice(letters, 60)), fill=255, font=ImageFont.load_default(height))
        y += int(height * rng.uniform(1.0, 1.6))
    return np.asarray(image) / 255.0


def noise(rng, size):
    return fractal(rng, size, 7, int(rng.integers(2, 16)))


def patches(rng, size):
    """Overlapping rectangles and ellipses: hard edges at all scales."""
    image = Image.new('F', (size, size), 0.5)
    draw = ImageDraw.Draw(image)
    for _ in range(int(rng.integers(10, 90))):
        x, y, w, h = rng.uniform(-0.1, 1, 2).tolist() + (rng.random(2) ** 3 * 0.6 + 0.01).tolist()
        put = draw.rectangle if rng.random() < 0.6 else draw.ellipse
        put([x * size, y * size, (x + w) * size, (y + h) * size], fill=rng.random())
    return np.asarray(image)


PATTERNS = (checker, stripes, plaid, dots, bricks, wood, wood, cells, text, text, noise, noise, noise, patches, patches)


def grey(rng, size=256):
    return np.clip(rng.choice(PATTERNS)(rng, size), 0, 1)


def picture(rng, size=256):
    """A pattern in two to four colours, often weathered by noise."""
    t = grey(rng, size)
    stops = np.stack([colour(rng) for _ in range(rng.integers(2, 5))])
    at = np.linspace(0, 1, len(stops))
    out = np.stack([np.interp(t, at, stops[:, c]) for c in range(3)], axis=-1)
    if rng.random() < 0.4:
        out = out * (1 - rng.uniform(0.2, 0.8) * noise(rng, size)[..., None])
    if rng.random() < 0.15:
        mask = grey(rng, size)[..., None]
        out = out * (1 - mask) + colour(rng) * mask
    return np.clip(out, 0, 1)
