"""Models to one file to train on.  python pack.py MODELS_DIR INDEX.md OUT.npz [--leave_out NAMES.txt]

Binary glTF files of one mesh, Y up, facing +Z. INDEX.md has a table with name, kind and `solid`, the share of what is
closed in that the winding number calls inside. Kept of a model: points (16 bits an axis, the box of all models), corners,
the part and colour of each triangle, kind and `solid`.
"""
import argparse, json, os, re, struct
import numpy as np

TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTH = {'SCALAR': 1, 'VEC2': 2, 'VEC3': 3, 'VEC4': 4}


def read(path):
    """points [V,3] (Z up, facing -Y), corners [T,3], linear colours [V,3]"""
    with open(path, 'rb') as f:
        raw = f.read()
    length = struct.unpack_from('<I', raw, 12)[0]
    doc = json.loads(raw[20:20 + length])
    blob = raw[28 + length:]

    def values(index):
        a = doc['accessors'][index]; v = doc['bufferViews'][a['bufferView']]; w = WIDTH[a['type']]
        start = v.get('byteOffset', 0) + a.get('byteOffset', 0)
        return np.frombuffer(blob, TYPES[a['componentType']], a['count'] * w, start).reshape(a['count'], w)
    part = doc['meshes'][0]['primitives'][0]
    p = values(part['attributes']['POSITION']).astype(np.float32)
    t = values(part['indices']).astype(np.int64).reshape(-1, 3)
    c = values(part['attributes']['COLOR_0'])[:, :3] / 255. if 'COLOR_0' in part['attributes'] else np.ones((len(p), 3))
    return np.stack([p[:, 0], -p[:, 2], p[:, 1]], 1), t, c


def codes(p, t, c):
    """per triangle: part * 128 + colour of 64 * 2 + 1; triangles that share points are one part"""
    _, same = np.unique(np.round(p * 2e4).astype(np.int64), axis=0, return_inverse=True)
    same = same.reshape(-1)
    root = np.arange(same.max() + 1)
    w = same[t]
    while True:                                   # the least label of its neighbours, until nothing changes
        low = root[w].min(1); old = root.copy()
        for k in range(3): np.minimum.at(root, w[:, k], low)
        root = root[root]
        if (root == old).all(): break
    _, part = np.unique(root[w[:, 0]], return_inverse=True)
    s = np.clip(c[t].mean(1), 0, 1) ** (1 / 2.2)
    q = np.minimum((s * 4).astype(int), 3)
    return (part.reshape(-1) * 128 + (q[:, 0] * 16 + q[:, 1] * 4 + q[:, 2]) * 2 + 1).astype(np.int32)


def main():
    ap = argparse.ArgumentParser(); ap.add_argument('models'); ap.add_argument('index'); ap.add_argument('out'); ap.add_argument('--leave_out')
    a = ap.parse_args()
    left = set(re.split(r'[\s,]+', open(a.leave_out).read())) if a.leave_out else set()
    facts = {}
    for line in open(a.index):
        cells = [x.strip() for x in line.split('|')]
        if len(cells) > 7:
            solid = next((float(x) for x in cells[6:9] if re.fullmatch(r'[01]\.\d+', x)), None)
            if solid is not None: facts[cells[1]] = cells[2], solid
    names = sorted(f[:-4] for f in os.listdir(a.models) if f.endswith('.glb'))
    names = [n for n in names if n in facts and n not in left]
    P, T, C, kinds, solid = [], [], [], [], []
    for n in names:
        p, t, c = read(f'{a.models}/{n}.glb')
        P.append(p); T.append(t); C.append(codes(p, t, c)); kinds.append(facts[n][0]); solid.append(facts[n][1])
    low, high = np.min([p.min(0) for p in P], 0), np.max([p.max(0) for p in P], 0)
    q = [np.round((p - low) / (high - low) * 65535).astype(np.uint16) for p in P]
    # differences of corners pack better
    t = np.concatenate(T).astype(np.uint16 if max(len(p) for p in P) <= 65536 else np.uint32)
    np.savez_compressed(a.out, names=np.array(names), kinds=np.array(kinds), solid=np.array(solid, np.float32), low=low, high=high, points=np.concatenate(q), corners=t,
                        codes=np.concatenate(C), npoints=np.array([len(p) for p in P]), ncorners=np.array([len(x) for x in T]))
    print(len(names), 'models', len(t), 'triangles', os.path.getsize(a.out), 'bytes')


if __name__ == '__main__':
    main()
