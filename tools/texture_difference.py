#!/usr/bin/env python3
"""How far the colours of textured.glb are from the true ones.

    texture_difference.py DRAFT.glb TRUTH_SHEET [--known 0,45,90,135,180] [--pictures FOLDER]

TRUTH_SHEET is a folder that `turnaround draw --ink flat` made of the model, with
any azimuths; draw it with the size, scale and placing of the sheet that the draft
was made of. The draft is drawn at each of its azimuths, from the textures of its
file alone, and compared where both show the subject, two pixels from the truth's
edges of depth and outline. Prints the mean difference of a channel, sRGB levels of
255, over all views, and over views that the draft was made of and the others.
Needs numpy and Pillow.
"""

import argparse
import io
import json
import struct
from pathlib import Path

import numpy as np
from PIL import Image

COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def read_glb(path):
    """Yields positions (n, 3), texture coordinates (n, 2) or None, triangles (m, 3) and
    the texture (h, w, 3) or None of each primitive of the node `model`; and its extras."""
    data = Path(path).read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20:20 + length])
    blob = data[28 + length:]

    def view(index):
        found = document["bufferViews"][index]
        start = found.get("byteOffset", 0)
        return blob[start:start + found["byteLength"]]

    def accessor(index):
        found = document["accessors"][index]
        raw = view(found["bufferView"])[found.get("byteOffset", 0):]
        width = WIDTHS[found["type"]]
        values = np.frombuffer(raw, COMPONENTS[found["componentType"]], found["count"] * width)
        return values.reshape(-1, width)

    def texture(material):
        found = document["materials"][material].get("pbrMetallicRoughness", {})
        if "baseColorTexture" not in found:
            return None
        source = document["textures"][found["baseColorTexture"]["index"]]["source"]
        picture = Image.open(io.BytesIO(view(document["images"][source]["bufferView"])))
        return np.asarray(picture.convert("RGB"))

    node = next(node for node in document["nodes"] if node.get("name") == "model")
    parts = []
    for primitive in document["meshes"][node["mesh"]]["primitives"]:
        attributes = primitive["attributes"]
        coordinates = attributes.get("TEXCOORD_0")
        parts.append((
            accessor(attributes["POSITION"]).astype(float),
            None if coordinates is None else accessor(coordinates).astype(float),
            accessor(primitive["indices"]).reshape(-1, 3),
            texture(primitive["material"]),
        ))
    return parts, document["nodes"][document["nodes"].index(node)]["extras"]["turnaround"]


def render(parts, azimuth_deg, size, pixels_per_metre, foot_row):
    """Colours (h, w, 3) and depths (h, w) of the parts, unlit, seen level from an azimuth."""
    width, height = size
    colours = np.full((height, width, 3), 255.0)
    depths = np.full((height, width), np.inf)
    sine, cosine = np.sin(np.radians(azimuth_deg)), np.cos(np.radians(azimuth_deg))
    for positions, coordinates, triangles, texture in parts:
        x, y, z = (positions * pixels_per_metre).T
        # glTF to turntable: X right, Y away from the viewer at 0, Z up.
        away, up = -z, y
        column = x * cosine + away * sine + width / 2
        row = foot_row - up
        depth = away * cosine - x * sine
        for triangle in triangles:
            px, py, pz = column[triangle], row[triangle], depth[triangle]
            area = (px[1] - px[0]) * (py[2] - py[0]) - (px[2] - px[0]) * (py[1] - py[0])
            left, right = max(int(px.min() - 0.5), 0), min(int(px.max() + 1.5), width)
            top, low = max(int(py.min() - 0.5), 0), min(int(py.max() + 1.5), height)
            if area == 0 or left >= right or top >= low:
                continue
            xs, ys = np.meshgrid(np.arange(left, right) + 0.5, np.arange(top, low) + 0.5)
            v = ((xs - px[0]) * (py[2] - py[0]) - (px[2] - px[0]) * (ys - py[0])) / area
            w = ((px[1] - px[0]) * (ys - py[0]) - (xs - px[0]) * (py[1] - py[0])) / area
            u = 1 - v - w
            near = u * pz[0] + v * pz[1] + w * pz[2]
            window = depths[top:low, left:right]
            seen = (u >= -1e-9) & (v >= -1e-9) & (w >= -1e-9) & (near < window)
            if not seen.any():
                continue
            window[seen] = near[seen]
            if texture is None:
                colour = 255.0
            else:
                weights = np.stack([u[seen], v[seen], w[seen]], axis=1)
                at = weights @ coordinates[triangle]
                tall, wide = texture.shape[:2]
                tx = np.clip((at[:, 0] * wide).astype(int), 0, wide - 1)
                ty = np.clip((at[:, 1] * tall).astype(int), 0, tall - 1)
                colour = texture[ty, tx]
            colours[top:low, left:right][seen] = colour
    return colours, depths


def inside(depth_counts, mask):
    """Where the truth is two pixels from its edges of outline and depth."""
    depth = depth_counts.astype(float)
    good = mask.copy()
    step = 0.02 * depth[mask].mean()
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            other = np.roll(depth, (dy, dx), (0, 1))
            good &= np.roll(mask, (dy, dx), (0, 1)) & (np.abs(other - depth) < step)
    return good


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("draft")
    parser.add_argument("truth")
    parser.add_argument("--known", default="0,45,90,135,180")
    parser.add_argument("--pictures")
    arguments = parser.parse_args()
    known = {float(angle) for angle in arguments.known.split(",")}
    parts, extras = read_glb(arguments.draft)
    sheet = Path(arguments.truth)
    document = json.loads((sheet / "sheet.json").read_text())
    groups = {"all": [], "drawn": [], "others": []}
    rows = []
    for view in document["views"]:
        drawing = np.asarray(Image.open(sheet / view["image"]).convert("RGB")).astype(float)
        azimuth = view["azimuth_deg"]
        padded = view["image"].removeprefix("view_").removesuffix(".png")
        mask = np.asarray(Image.open(sheet / f"mask_{padded}.png")) > 127
        counts = np.asarray(Image.open(sheet / f"depth_{padded}.png"))
        height, width = mask.shape
        # The draft stands on its feet: so does the truth.
        foot = np.nonzero(mask.any(axis=1))[0].max() + 1
        scale = extras["pixels_per_metre"]
        colours, depths = render(parts, azimuth, (width, height), scale, foot)
        both = inside(counts, mask) & np.isfinite(depths)
        if not both.any():
            continue
        off = np.abs(colours - drawing)[both]
        groups["all"].append(off)
        groups["drawn" if azimuth in known else "others"].append(off)
        rows.append(np.concatenate([drawing, colours], axis=0))
    for name, found in groups.items():
        if found:
            print(f"{name} {np.concatenate(found).mean():.2f}", end="  ")
    print()
    if arguments.pictures:
        folder = Path(arguments.pictures)
        folder.mkdir(parents=True, exist_ok=True)
        picture = np.concatenate(rows, axis=1).clip(0, 255).astype(np.uint8)
        Image.fromarray(picture).save(folder / f"{sheet.name}.png")


if __name__ == "__main__":
    main()
