"""Models (pack.py) as training subjects: chosen by kind, varied, sorted into grid shapes; see `data.batch`."""
import math, multiprocessing as mp
import numpy as np, torch
from data import BUCKETS

# how often each kind is taken; of unknown ones as often as the last
SHARES = {'humanoid': .20, 'humanoid-stylised': .02, 'humanoid-posed': .08, 'animal-other': .15, 'quadruped': .09, 'robot': .06,
          'vehicle': .09, 'building-prop': .14, 'furniture': .08, 'weapon-tool': .06, 'plant-food': .06}
OPEN = .6       # below this `solid` a model is a shell: what is closed in on six sides, and its surface, count as inside


def turn(a): c, s = math.cos(a), math.sin(a); return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], np.float32)


def rotation(rng):
    q = rng.normal(size=4); q /= np.linalg.norm(q); w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]], np.float32)


class Meshes:
    """`take` as that of `data.Pool`, from models"""
    def __init__(s, path, seed=0):
        z = np.load(path); n, m = z['npoints'], z['ncorners']
        s.names, s.kinds, s.solid = z['names'], z['kinds'], z['solid']
        points = z['low'] + z['points'].astype(np.float32) / 65535 * (z['high'] - z['low'])
        s.points = np.split(points.astype(np.float32), np.cumsum(n)[:-1]); s.corners = np.split(z['corners'].astype(np.int32), np.cumsum(m)[:-1])
        s.codes = np.split(z['codes'], np.cumsum(m)[:-1])
        w = np.zeros(len(n))
        for kind in np.unique(s.kinds):
            of = s.kinds == kind; w[of] = SHARES.get(str(kind), .06) / of.sum()
        w *= np.where(s.solid < OPEN, .4, 1) * np.where(m > 16000, .3, 1)
        s.p = w / w.sum(); s.props = np.isin(s.kinds, ['weapon-tool', 'building-prop', 'plant-food']) & (s.solid >= OPEN) & (m < 4000)
        s.rng = np.random.default_rng(seed); s.b = [[] for _ in BUCKETS]; s.q = None

    def subject(s):
        """points, corners, codes, kind, whether it is a shell"""
        r = s.rng; i = int(r.choice(len(s.p), p=s.p)); p, t, c = s.points[i].copy(), s.corners[i], s.codes[i]; shell = s.solid[i] < OPEN
        kind = str(s.kinds[i]); figure = kind.startswith(('humanoid', 'animal', 'quadruped', 'robot'))
        if r.random() < (.2 if figure else .08):          # something held, worn or standing by
            j = int(r.choice(np.flatnonzero(s.props))); q = s.points[j]; q = (q - (q.max(0) + q.min(0)) / 2) * np.float32(r.uniform(.15, .5))
            q = q @ (rotation(r) if r.random() < .4 else turn(r.uniform(0, 6.3))).T + p[int(r.integers(len(p)))]
            t = np.concatenate([t, s.corners[j] + len(p)]); c = np.concatenate([c, s.codes[j] + (int(c.max()) // 128 + 1) * 128]); p = np.concatenate([p, q.astype(np.float32)])
        if r.random() < .5: p[:, 0] = -p[:, 0]
        q = r.random()
        if not figure and q < .3: p = p @ turn(math.pi / 2 * r.integers(4)).T
        elif not figure and q < .5 or q < .06: p = p @ turn(r.uniform(0, 6.3)).T
        elif q < .7 and r.random() < .3: p = p @ turn(r.uniform(-.15, .15)).T
        if not figure and r.random() < .06: p = p @ rotation(r).T
        if r.random() < .6: p = p * np.exp(r.normal(size=3) * .12).astype(np.float32)
        if r.random() < .3:                               # bent
            for o, by in ((0, 2), (1, 2), (2, 0)):
                if r.random() < .5: f = r.uniform(1, 3); p[:, o] += np.float32(r.uniform(.02, .2) / f) * np.sin(f * p[:, by] + r.uniform(0, 6.3))
        return np.ascontiguousarray(p, np.float32), t, c, kind, shell

    def refill(s):
        for _ in range(64):
            p, t, c, kind, shell = s.subject(); lo, hi = p.min(0), p.max(0); e = np.maximum(hi - lo, 1e-3); r = s.rng
            pit = [max(e[2] / d[0], e[1] / d[1], e[0] / d[2]) for d in BUCKETS]
            bk = int(np.argmin(pit)) if r.random() > .2 else 0
            pitch = pit[bk] / r.uniform(.78, .97); d = BUCKETS[bk]
            slack = np.array([d[2], d[1], d[0]]) * pitch - e
            centre = (lo + hi) / 2 + r.uniform(-.35, .35, 3) * np.minimum(slack, .2 * e.max())
            s.b[bk].append((p, t, c, np.array([*centre, pitch], np.float32), kind, shell))

    def pick(s, B, bk=None):
        """a batch on the host: grid shape; points, corners, owners, codes, shells, grids; kinds"""
        while (max(len(x) for x in s.b) if bk is None else len(s.b[bk])) < B: s.refill()
        w = np.array([len(x) if len(x) >= B else 0 for x in s.b], float)
        if bk is None: bk = int(s.rng.choice(len(w), p=w / w.sum()))
        it, s.b[bk] = s.b[bk][:B], s.b[bk][B:]
        first = np.cumsum([0] + [len(x[0]) for x in it[:-1]])
        arrays = (np.concatenate([x[0] for x in it]), np.concatenate([x[1] + f for x, f in zip(it, first)]).astype(np.int32), np.repeat(np.arange(B), [len(x[1]) for x in it]).astype(np.int32),
                  np.concatenate([x[2] for x in it]), np.array([x[5] for x in it]), np.stack([x[3] for x in it]))
        return bk, [np.ascontiguousarray(x) for x in arrays], [x[4] for x in it]

    def ahead(s, B, workers, seed):
        """batches of B are made by processes from now on; call before CUDA is touched"""
        s.q = mp.Queue(maxsize=3 * workers)
        def work(i):
            s.rng = np.random.default_rng([seed, i])
            while True: s.q.put(s.pick(B))
        s.w = [mp.Process(target=work, args=(i,), daemon=True) for i in range(workers)]
        for w in s.w: w.start()

    def take(s, ker, B, bk=None):
        bk, held, kinds = s.q.get() if s.q else s.pick(B, bk)
        held = [torch.from_numpy(x) for x in held]
        *scene, g = [x.pin_memory().to(ker.dev, non_blocking=True) if ker.dev == 'cuda' else x for x in held]
        return bk, MeshScene(*scene), g, kinds


class MeshScene:
    """a batch of meshes: points [V,3], corners [T,3], subject and code of each triangle, shells [B]"""
    def __init__(s, points, corners, owner, codes, shells): s.points, s.corners, s.owner, s.codes, s.shells = points, corners, owner, codes, shells
    def rays(s, ker, g, v, H, W, up, far): return ker.mesh_rays(s.points, s.corners, s.owner, s.codes, g, v, H, W, up)
    def occupancy(s, ker, g, dims):
        """[B, *dims] twice, 1 inside: by the winding number along each axis, of shells what six sides close in and the
        surface; and 1 on sheets, which bound nothing or are thinner than a cell: both cells that they lie between"""
        total, count = ker.crossings(s.points, s.corners, s.owner, g, dims); sides = []; hits = []; closed = 0; surface = False
        for axis, (dim, flip) in enumerate(((3, False), (2, False), (1, True))):
            n, k = total[:, axis], count[:, axis]
            if flip: n, k = n.flip(dim), k.flip(dim)
            below = n.cumsum(dim, dtype=torch.int32); sees = k.cumsum(dim, dtype=torch.int32); whole, all_ = below.narrow(dim, -1, 1), sees.narrow(dim, -1, 1)
            w = below.float() - whole.float() / 2; hit = k > 0; k = (sees > 0).to(torch.uint8) + (all_ > sees).to(torch.uint8)
            if flip: w, k, hit = w.flip(dim), k.flip(dim), hit.flip(dim)
            sides.append(w); hits.append((dim, -1 if flip else 1, hit)); closed = closed + k; surface = surface | hit
        a, b, c = sides                                       # their median: one may miss a crossing
        solid = torch.maximum(torch.minimum(a, b), torch.minimum(torch.maximum(a, b), c)).abs() > .5
        solid = solid | s.shells.view(-1, 1, 1, 1) & ((closed == 6) | surface)
        sheets = torch.zeros_like(solid)
        for dim, by, hit in hits:                             # a crossing lies between a cell and the one before it
            free = hit & ~solid & ~solid.roll(by, dim)
            sheets |= free | free.roll(-by, dim)
        return solid.float(), sheets.float()
