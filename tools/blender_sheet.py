"""Renders a model's sheet with Blender, for comparing with `turnaround draw`.

    blender -b --factory-startup --python-exit-code 1 --python tools/blender_sheet.py -- \
        MODEL.obj OUT_DIR AZIMUTH...

The dissertation's recipe (Arys 2020, section 3.2): white emissive surface, Freestyle lines of the
usual kinds with a crease angle of 134.43 degrees, orthographic scale 7.3, the camera 8 units from
the axis, 1920x1080. Each view gives a PNG with the lines and an EXR with the depth pass; halving
both is left to others and not timed. Prints the seconds that importing and rendering took as JSON.
"""

import json
import math
import sys
import time
from pathlib import Path

import bpy

CREASE_ANGLE_DEG = 134.43
ORTHOGRAPHIC_SCALE = 7.3
CAMERA_DISTANCE = 8.0
# At twice the final size.
LINE_WIDTH_PX = 3.0
SIZE_PX = (1920, 1080)


def main() -> None:
    model, folder, *azimuths = sys.argv[sys.argv.index("--") + 1 :]
    begun = time.perf_counter()
    scene = empty_scene()
    import_model(model)
    imported = time.perf_counter()
    camera = add_camera(scene)
    set_up_render(scene)
    set_up_lines(scene)
    set_up_depth(scene, Path(folder))
    view_seconds = []
    begun_cpu = time.process_time()
    for azimuth in azimuths:
        started = time.perf_counter()
        place(camera, float(azimuth))
        scene.render.filepath = str(Path(folder) / f"view_{float(azimuth):06.2f}.png")
        scene.frame_current = round(float(azimuth) * 100)
        bpy.ops.render.render(write_still=True)
        view_seconds.append(time.perf_counter() - started)
    figures = {
        "blender": bpy.app.version_string,
        "views": len(azimuths),
        "import_s": round(imported - begun, 3),
        "render_s": round(sum(view_seconds), 3),
        "render_cpu_s": round(time.process_time() - begun_cpu, 3),
        "slowest_view_s": round(max(view_seconds), 3),
    }
    print("FIGURES", json.dumps(figures))


def empty_scene():
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    return bpy.context.scene


def import_model(path: str) -> None:
    """Keeps the file's axes: Z is up, the front looks towards -Y."""
    bpy.ops.wm.obj_import(filepath=path, forward_axis="Y", up_axis="Z")
    material = bpy.data.materials.new("white")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    emission = nodes.new("ShaderNodeEmission")
    output = nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    for thing in bpy.data.objects:
        if thing.type == "MESH":
            thing.data.materials.clear()
            thing.data.materials.append(material)


def add_camera(scene):
    data = bpy.data.cameras.new("camera")
    data.type = "ORTHO"
    data.ortho_scale = ORTHOGRAPHIC_SCALE
    camera = bpy.data.objects.new("camera", data)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return camera


def place(camera, azimuth_deg: float) -> None:
    angle = math.radians(azimuth_deg)
    camera.location = (CAMERA_DISTANCE * math.sin(angle), -CAMERA_DISTANCE * math.cos(angle), 0.0)
    camera.rotation_euler = (math.pi / 2, 0.0, angle)


def set_up_render(scene) -> None:
    """The cheapest picture that Cycles makes: nothing is lit, so one sample is enough."""
    render = scene.render
    render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 1
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 0
    render.use_persistent_data = True
    render.resolution_x, render.resolution_y = SIZE_PX
    render.resolution_percentage = 100
    render.image_settings.file_format = "PNG"
    render.image_settings.color_mode = "BW"
    scene.view_settings.view_transform = "Standard"
    world = bpy.data.worlds.new("white")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    scene.world = world


def set_up_lines(scene) -> None:
    scene.render.use_freestyle = True
    scene.render.line_thickness_mode = "ABSOLUTE"
    scene.render.line_thickness = 1.0
    layer = bpy.context.view_layer
    layer.use_freestyle = True
    settings = layer.freestyle_settings
    settings.crease_angle = math.radians(CREASE_ANGLE_DEG)
    line_set = settings.linesets[0] if settings.linesets else settings.linesets.new("lines")
    line_set.select_silhouette = True
    line_set.select_border = True
    line_set.select_crease = True
    if line_set.linestyle is None:
        line_set.linestyle = bpy.data.linestyles.new("lines")
    line_set.linestyle.thickness = LINE_WIDTH_PX
    line_set.linestyle.color = (0.0, 0.0, 0.0)


def set_up_depth(scene, folder: Path) -> None:
    bpy.context.view_layer.use_pass_z = True
    scene.use_nodes = True
    nodes = scene.node_tree.nodes
    nodes.clear()
    layers = nodes.new("CompositorNodeRLayers")
    composite = nodes.new("CompositorNodeComposite")
    scene.node_tree.links.new(layers.outputs["Image"], composite.inputs["Image"])
    files = nodes.new("CompositorNodeOutputFile")
    files.base_path = str(folder)
    files.format.file_format = "OPEN_EXR"
    files.file_slots[0].path = "depth_"
    scene.node_tree.links.new(layers.outputs["Depth"], files.inputs[0])


main()
