# SPDX-License-Identifier: Apache-2.0
"""Path-traces a fog volume with Cycles, for compare_with_cycles.py. Runs inside of Blender:

    blender -b --factory-startup -P cycles_render.py -- job.json

The job names the volume, its extinction per metre at density 1, the Henyey-Greenstein asymmetry, a camera, a sun and
the radiance of a sky that is the same in all directions. The cloud absorbs nothing. Units are those of nephos: radiance
1 is that of a white surface facing a sun of colour 1, so that sun has the irradiance pi. Writes linear float RGBA as a
NumPy array of rows from the top, and a second picture with another seed, so that the noise can be measured. Or,
given pairs of files as `convert`, turns EXR files into such arrays."""

import json
import math
import os
import sys

import bpy
import mathutils
import numpy


def clear():
    for each in list(bpy.data.objects):
        bpy.data.objects.remove(each)


def add_volume(job):
    bpy.ops.object.volume_import(filepath=job["volume"])
    volume = bpy.context.object
    # Blender turns every volume from y up to z up.
    volume.rotation_euler = (math.pi / 2, 0, 0) if job["up"] == "y" else (0, 0, 0)
    volume.data.render.step_size = job["step_m"]
    volume.data.render.space = "WORLD"
    material = bpy.data.materials.new("cloud")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    density = nodes.new("ShaderNodeAttribute")
    density.attribute_name = job["grid"]
    extinction = nodes.new("ShaderNodeMath")
    extinction.operation = "MULTIPLY"
    extinction.inputs[1].default_value = job["extinction_per_m"]
    scatter = nodes.new("ShaderNodeVolumeScatter")
    scatter.inputs["Color"].default_value = (1, 1, 1, 1)
    scatter.inputs["Anisotropy"].default_value = job["g"]
    output = nodes.new("ShaderNodeOutputMaterial")
    links.new(density.outputs["Fac"], extinction.inputs[0])
    links.new(extinction.outputs[0], scatter.inputs["Density"])
    links.new(scatter.outputs["Volume"], output.inputs["Volume"])
    material.cycles.volume_step_rate = 1
    volume.data.materials.append(material)


def add_sun(job):
    data = bpy.data.lights.new("sun", "SUN")
    data.energy = math.pi
    data.color = job["sun_colour"]
    data.angle = math.radians(0.53)
    sun = bpy.data.objects.new("sun", data)
    bpy.context.collection.objects.link(sun)
    to_sun = mathutils.Vector(job["to_sun"])
    sun.rotation_euler = to_sun.to_track_quat("Z", "Y").to_euler()  # a sun shines along its -z


def add_sky(scene, radiance):
    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    background = scene.world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*radiance, 1)
    background.inputs["Strength"].default_value = 1


def add_camera(scene, job):
    data = bpy.data.cameras.new("eye")
    data.sensor_fit = "VERTICAL"
    data.angle = math.radians(job["vertical_fov_deg"])
    data.clip_end = 1e6
    camera = bpy.data.objects.new("eye", data)
    bpy.context.collection.objects.link(camera)
    camera.location = job["eye_m"]
    way = mathutils.Vector(job["target_m"]) - mathutils.Vector(job["eye_m"])
    camera.rotation_euler = way.to_track_quat("-Z", "Y").to_euler()
    scene.camera = camera


def set_up_cycles(scene, job):
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = job["size"]
    scene.render.resolution_percentage = 100
    scene.render.threads_mode = "FIXED"
    scene.render.threads = job["threads"]
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.color_mode = "RGBA"
    scene.view_settings.view_transform = "Raw"
    cycles = scene.cycles
    cycles.samples = job["samples"]
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.pixel_filter_type = "BOX"
    cycles.filter_width = 1.0
    cycles.max_bounces = cycles.volume_bounces = job["bounces"]
    cycles.transparent_max_bounces = 64
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.volume_step_rate = 1
    cycles.volume_max_steps = 4096


def to_array(picture, array):
    """From an EXR file to a NumPy file: linear, rows from the top."""
    image = bpy.data.images.load(picture)
    image.colorspace_settings.name = "Non-Color"
    image.alpha_mode = "CHANNEL_PACKED"  # leave colours as they are
    width, height = image.size
    pixels = numpy.array(image.pixels[:], dtype=numpy.float32).reshape(height, width, 4)
    numpy.save(array, pixels[::-1])
    os.remove(picture)


def render(scene, seed, name):
    scene.cycles.seed = seed
    scene.render.filepath = name + ".exr"
    bpy.ops.render.render(write_still=True)
    to_array(scene.render.filepath, name + ".npy")


def main():
    with open(sys.argv[sys.argv.index("--") + 1], encoding="utf-8") as file:
        job = json.load(file)
    if "convert" in job:
        for picture, array in job["convert"]:
            to_array(picture, array)
        return
    clear()
    scene = bpy.context.scene
    add_volume(job)
    add_sun(job)
    add_sky(scene, job["sky"])
    add_camera(scene, job)
    set_up_cycles(scene, job)
    for seed in range(2):
        render(scene, seed, f"{job['out']}-{seed}")


main()
