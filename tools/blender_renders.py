"""Renders a draft with Blender, to see it as a modeller will.

    blender -b --factory-startup --python-exit-code 1 --python tools/blender_renders.py -- \
        DRAFT.glb OUT_DIR [SIZE_PX] [own]

Imports the GLB, hides the reference planes, covers the rest in grey clay (or, with `own`, leaves it its own
materials), and renders front, quarter, side and back with an
orthographic camera and Cycles on the processor. Prints the names of the objects and the model's bounds
in metres as JSON, and fails unless it stands on the ground and, as drafts do by default, 1.8 m high.
Needs NumPy where Blender's own Python has none.
"""

import json
import math
import sys
from pathlib import Path

import bpy
from mathutils import Vector

DIRECTIONS = {"front": (0, -1, 0), "quarter": (1, -1, 0), "side": (1, 0, 0), "back": (0, 1, 0)}
HEIGHT_M = 1.8
TOLERANCE_M = 1e-3
SAMPLES = 32


def main() -> None:
    model, folder, *rest = sys.argv[sys.argv.index("--") + 1 :]
    size = [word for word in rest if word.isdigit()]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=model)
    low, high = bounds()
    if "own" not in rest:
        cover_in_clay()
    names = sorted(item.name for item in bpy.data.objects)
    print(json.dumps({"objects": names, "low_m": list(low), "high_m": list(high)}))
    set_up_render(int(size[0]) if size else 400)
    camera = add_camera(max(high - low) * 1.08)
    middle = (low + high) / 2
    for name, direction in DIRECTIONS.items():
        towards = Vector(direction).normalized()
        camera.location = middle + towards * 10
        camera.rotation_euler = (-towards).to_track_quat("-Z", "Y").to_euler()
        bpy.context.scene.render.filepath = str(Path(folder).resolve() / f"{name}.png")
        bpy.ops.render.render(write_still=True)
    if abs(low.z) > TOLERANCE_M or abs(high.z - HEIGHT_M) > TOLERANCE_M:
        raise SystemExit(f"stands from {low.z} to {high.z} m, not from 0 to {HEIGHT_M} m")


def bounds() -> tuple[Vector, Vector]:
    """Corners of what is not a reference plane, which are hidden."""
    points = []
    for item in bpy.data.objects:
        if item.name.startswith("ref_"):
            item.hide_render = True
        elif item.type == "MESH":
            points += [item.matrix_world @ vertex.co for vertex in item.data.vertices]
    return tuple(Vector(pick(axis) for axis in zip(*points)) for pick in (min, max))


def cover_in_clay() -> None:
    """One grey for all: vertex colours and textures would hide the form."""
    clay = bpy.data.materials.new("clay")
    clay.diffuse_color = (0.5, 0.5, 0.5, 1)
    clay.use_nodes = True
    clay.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.5, 0.5, 0.5, 1)
    clay.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 1
    for mesh in bpy.data.meshes:
        for slot in range(len(mesh.materials)):
            mesh.materials[slot] = clay


def add_camera(width_m: float) -> bpy.types.Object:
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type = "ORTHO"
    camera.data.ortho_scale = width_m
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera
    return camera


def set_up_render(size_px: int) -> None:
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = SAMPLES
    scene.cycles.use_denoising = False
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x = scene.render.resolution_y = size_px
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"].inputs
    background[0].default_value = (1, 1, 1, 1)
    background[1].default_value = 0.9
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy = 1.8
    sun.rotation_euler = (math.radians(55), 0, math.radians(-50))
    scene.collection.objects.link(sun)


main()
