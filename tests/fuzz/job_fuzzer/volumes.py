"""Small volumes of all kinds: samples, types and geometry, with numbers that matter for a job on them."""

import math

import numpy

TYPES = {"uint8": "u1", "int8": "i1", "uint16": "<u2", "int16": "<i2", "uint32": "<u4", "int32": "<i4", "float32": "<f4", "float64": "<f8"}
WHOLE_IDENTITY = (1, 0, 0, 0, 1, 0, 0, 0, 1)


def positions(dims):
    """x, y and z of each sample in an array of z, y, x, from -1 to 1."""
    axes = [numpy.linspace(-1, 1, count) if count > 1 else numpy.zeros(1) for count in dims]
    z, y, x = numpy.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    return x, y, z


def field_of(rng, dims):
    """The name of a shape, and its samples from -1 to 1."""
    noise = numpy.random.default_rng(rng.getrandbits(64))
    shape = tuple(reversed(dims))
    x, y, z = positions(dims)
    names = ["ball", "shell", "plane", "steps", "noise", "smooth", "checkers", "spike", "two", "few", "saddle"]
    name = rng.choice(names * 3 + ["constant"])
    if name == "constant":
        field = numpy.full(shape, rng.choice([-1.0, 0.0, 1.0]))
    elif name in ("ball", "shell"):
        centre = [rng.uniform(-1, 1) for _ in range(3)] if rng.random() < 0.5 else [0, 0, 0]
        distance = numpy.sqrt((x - centre[0]) ** 2 + (y - centre[1]) ** 2 + (z - centre[2]) ** 2)
        field = rng.uniform(0.2, 1.2) - distance
        field = field if name == "ball" else 0.3 - numpy.abs(field)
    elif name in ("plane", "steps"):
        normal = rng.choice([[1, 0, 0], [0, 1, 0], [0, 0, 1], [rng.uniform(-1, 1) for _ in range(3)]])
        field = x * normal[0] + y * normal[1] + z * normal[2] + rng.choice([0, rng.uniform(-0.5, 0.5)])
        field = field if name == "plane" else numpy.sign(field)
    elif name == "noise":
        field = noise.uniform(-1, 1, shape)
    elif name == "smooth":
        field = noise.uniform(-1, 1, shape)
        for axis in range(3):
            field = (field + numpy.roll(field, 1, axis)) / 2
    elif name == "checkers":
        field = numpy.where(numpy.indices(shape).sum(axis=0) % 2 == 0, -1.0, 1.0)
    elif name == "spike":
        field = numpy.full(shape, -1.0)
        field[tuple(rng.randrange(count) for count in shape)] = 1
    elif name == "saddle":
        field = x * y + rng.choice([0, 0.3]) * z
    else:
        levels = numpy.linspace(-1, 1, 2 if name == "two" else rng.choice([3, 5, 9]))
        field = noise.choice(levels, shape)
    return name, numpy.clip(field, -1, 1)


def whole_samples(rng, field, kind):
    """The field as whole numbers: of few values, or up to the ends of the type."""
    ends = numpy.iinfo(kind)
    span = rng.choice([1, 2, 5, 40, 255, int(ends.max) - int(ends.min)])
    span = min(span, int(ends.max) - int(ends.min))
    least = rng.choice([int(ends.min), int(ends.max) - span, 0, -span // 2])
    least = max(int(ends.min), min(int(ends.max) - span, least))
    steps = numpy.rint((field + 1) / 2 * float(span))
    return f"{least}..{least + span}", (steps.astype(numpy.int64) + least).astype(kind)


def float_samples(rng, field, kind):
    """The field at any size, also of numbers that are denormal, that differ by one step, or that are none."""
    limits = numpy.finfo(kind)
    digits = 300 if kind.endswith("8") else 37
    scale = rng.choice([1, 1, 100, 10 ** rng.uniform(-digits, digits), float(limits.tiny), float(limits.smallest_subnormal) * 4, float(limits.max)])
    offset = rng.choice([0, 0, 0, 0.5, scale, 10 ** rng.uniform(-digits, digits)])
    text = f"{scale:g} * field + {offset:g}"
    with numpy.errstate(all="ignore"):
        samples = (field * scale + offset).astype(kind)
        if rng.random() < 0.1:
            text = f"steps of one number at {offset:g}"
            samples = numpy.full(field.shape, offset, kind)
            samples = numpy.where(field > 0, numpy.nextafter(samples, numpy.asarray(math.inf, kind)), samples).astype(kind)
        if rng.random() < 0.06:
            strangers = rng.choice([[math.nan], [math.inf], [-math.inf], [math.nan, math.inf, -math.inf]])
            noise = numpy.random.default_rng(rng.getrandbits(64))
            hit = noise.random(field.shape) < rng.choice([0.002, 0.2, 1])
            samples[hit] = noise.choice(strangers, field.shape)[hit]
            text += f", some {strangers}"
    return text, samples


def spacing_of(rng):
    kind = rng.random()
    if kind < 0.4:
        return [1.0, 1.0, 1.0]
    size = 1 if rng.random() < 0.6 else 10 ** rng.uniform(-6, 6)
    ratio = rng.choice([2, 10, 1000])
    spacing = [size * ratio ** rng.uniform(-0.5, 0.5) for _ in range(3)]
    if rng.random() < 0.3:
        spacing[rng.randrange(3)] = spacing[0] * rng.choice([ratio, 1 / ratio])
    if kind > 0.98:
        spacing[rng.randrange(3)] = rng.choice([0, -1, 1e-7, 1e7, 1e300, 5e-324, "nan", "inf", 1e-6, 1e6])
    return [each if isinstance(each, str) or kind > 0.98 else min(1e6, max(1e-6, each)) for each in spacing]


def direction_of(rng):
    kind = rng.random()
    if kind < 0.5:
        return list(WHOLE_IDENTITY)
    matrix = numpy.eye(3)
    if kind < 0.65:  # other axes, mirrored
        matrix = matrix[:, rng.sample(range(3), 3)] * [rng.choice([-1, 1]) for _ in range(3)]
    elif kind < 0.97:
        noise = numpy.random.default_rng(rng.getrandbits(64))
        matrix = numpy.linalg.qr(noise.normal(size=(3, 3)))[0]
        if kind > 0.8:  # sheared, at most to where it is rejected
            matrix = matrix + rng.choice([0.1, 0.5, 2]) * noise.normal(size=(3, 3))
            matrix = matrix / numpy.linalg.norm(matrix, axis=0)
    else:
        matrix = numpy.array(rng.choice([[[0] * 3] * 3, [[1] * 3] * 3, [[2, 0, 0], [0, 2, 0], [0, 0, 2]]]), float)
    return [float(each) for each in matrix.reshape(-1)]


def origin_of(rng, spacing):
    kind = rng.random()
    if kind < 0.4:
        return [0.0, 0.0, 0.0]
    sizes = [each for each in spacing if isinstance(each, float) and math.isfinite(each)] or [1.0]
    far = rng.choice([1, 100, 10000, 40000, 60000 if kind < 0.9 else 1e5]) * min(sizes)
    if kind > 0.98:
        return [rng.choice([1e300, -1e15, "nan", 5e-324]) for _ in range(3)]
    return [rng.choice([-far, far, rng.uniform(-far, far), 0.0]) for _ in range(3)]


class Volume:
    """Samples and the query that describes them."""

    def __init__(self, rng, large=False):
        self.rng = rng
        sides = [1 if rng.random() < 0.04 else rng.choice([2, 3, rng.randint(2, 12), rng.randint(4, 12)]) for _ in range(3)]
        self.dims = sides if rng.random() < 0.8 else [max(sides)] * 3
        if large:
            self.dims = [rng.randint(24, 40) for _ in range(3)]
        self.type = rng.choice(list(TYPES))
        kind = TYPES[self.type]
        if large and "f" not in kind:
            self.type, kind = "int8", TYPES["int8"]  # at most 256 labels
        shape, field = field_of(rng, self.dims)
        self.told, self.samples = (float_samples if "f" in kind else whole_samples)(rng, field, kind)
        self.told = f"{shape}, {self.told}"
        self.spacing = spacing_of(rng)
        self.direction = direction_of(rng)
        self.origin = origin_of(rng, self.spacing)
        finite = self.samples[numpy.isfinite(self.samples)]
        self.values = numpy.unique(finite) if finite.size else numpy.zeros(1)

    def query(self):
        text = {"dims": self.dims, "type": [self.type], "spacing": self.spacing, "origin": self.origin, "direction": self.direction}
        return "&".join(f"{name}={','.join(each if isinstance(each, str) else repr(each) for each in values)}" for name, values in text.items())

    def bytes(self):
        return self.samples.tobytes()

    # The values that a Maker needs of the volume.

    def number(self):
        """An iso-value: at, between, beside or beyond the samples."""
        rng = self.rng
        low, high = float(self.values[0]), float(self.values[-1])
        value = float(rng.choice(list(self.values[:64])))
        other = float(rng.choice(list(self.values[-64:])))
        middle = value / 2 + other / 2
        near = [middle, middle, low / 2 + high / 2, low / 2 + high / 2, value, math.nextafter(value, math.inf), math.nextafter(value, -math.inf)]
        far = [low, high, low - 1, high + 1, 0.0, -0.0, 1e300, -1e300, 1.7976931348623157e308, 5e-324, 1e-300, float(2**53 + 2)]
        chosen = rng.choice(near if rng.random() < 0.8 else far)
        return chosen if math.isfinite(chosen) else value

    def integer(self):
        """A label, most often one of the samples."""
        if self.rng.random() < 0.1:
            return self.rng.choice([0, 1, -1, 2**31, 2**32 - 1, -(2**31)])
        value = float(self.rng.choice(list(self.values[:64])))
        return int(max(-(2.0**31), min(2.0**32 - 1, value)))

    def steps(self):
        """The three steps between samples in millimetres, as columns; of ordinary numbers only."""
        spacing = [each if isinstance(each, (int, float)) and 0 < each < 1e9 else 1 for each in self.spacing]
        return numpy.array(self.direction, float).reshape(3, 3) * spacing

    def length(self):
        sizes = numpy.linalg.norm(self.steps(), axis=0)
        least = -4 if self.rng.random() < 0.75 else -12
        return float(self.rng.choice(list(sizes)) * 10 ** self.rng.uniform(least, 2))

    def box(self):
        """The smallest and the largest corner of a box that holds most of the volume, or all of it."""
        corners = numpy.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (numpy.array(self.dims) - 1.0)
        places = corners @ self.steps().T + numpy.array([each if isinstance(each, float) and abs(each) < 1e18 else 0 for each in self.origin])
        low, high = places.min(axis=0), places.max(axis=0)
        shares = numpy.array([[self.rng.choice([0, -0.1, self.rng.uniform(0, 0.3)]) for _ in range(3)] for _ in range(2)])
        return [(low + shares[0] * (high - low)).tolist(), (high - shares[1] * (high - low)).tolist()]

    def point(self):
        """Most often one in the volume's box, or close to it."""
        if self.rng.random() < 0.03:
            return [self.rng.choice([0.0, 1e300, -1e300, 1e-300]) for _ in range(3)]
        share = [self.rng.choice([0, 1, 0.5, self.rng.uniform(-0.2, 1.2)]) for _ in range(3)]
        index = [share[axis] * (self.dims[axis] - 1) for axis in range(3)]
        origin = [each if isinstance(each, float) and abs(each) < 1e18 else 0 for each in self.origin]
        return [float(each) for each in self.steps() @ index + origin]
