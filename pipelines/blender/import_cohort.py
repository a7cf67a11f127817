"""Loads a model or a scene of cohort into Blender (2.93 or newer): an animated camera and the points.

In Blender: Edit > Preferences > Add-ons > Install, then File > Import > cohort. From a shell:

    blender --python import_cohort.py -- MODEL [OUT.blend]

MODEL is a model folder of `cohort reconstruct`, a scene folder of `cohort sfm`, any folder with
COLMAP's text files, or a transforms.json. Reading and geometry need NumPy alone; Blender is what is
below the line `import bpy`.
"""

import json
import math
import os
import re
import sys
from collections import namedtuple

import numpy as np

bl_info = {
    "name": "Import cohort",
    "description": "Camera and points of cohort or COLMAP",
    "author": "The cohort authors",
    "version": (1, 0, 0),
    "blender": (2, 93, 0),
    "location": "File > Import > cohort model or scene",
    "category": "Import-Export",
}

SENSOR_WIDTH_MM = 36.0
LAST_FRAME = 1048574  # Blender's

# A pinhole: focal lengths and principal point in pixels, whose (0, 0) is the top-left corner.
# `distorted`: the pictures have a distortion, which Blender's camera cannot have.
Camera = namedtuple("Camera", "width height fx fy cx cy distorted")
# `number`: the frame's in Blender, 1 for the first of the clip. `world_from_blender`: 4x4, of a camera
# with x right, y up, z back. `zoom`: by how much its focal length is that of the model's camera.
Frame = namedtuple("Frame", "number name world_from_blender zoom", defaults=(1.0,))
# Points (N, 3) in the world; colours (N, 3), 0 to 255. `fps` None: unknown. `images`: the folder of
# the pictures, or None.
Model = namedtuple("Model", "camera frames points colours fps images")
# What Blender's camera has to be; `aspect`: how much taller than wide a pixel is.
Lens = namedtuple("Lens", "focal_mm shift_x shift_y aspect")


class ImportFailed(Exception):
    """What is wrong, where, and what to do."""


# What the reading of a file that is not as it should be ends in.
BAD = (
    ArithmeticError,
    AttributeError,
    IndexError,
    KeyError,
    MemoryError,
    OSError,
    RecursionError,
    TypeError,
    ValueError,
)


def read(path):
    """The Model in a folder, or of a transforms.json."""
    path = os.path.abspath(path)
    try:
        model = read_model(path)
    except BAD as error:
        raise ImportFailed(f"{path} does not have the form that cohort writes: {error!r}") from error
    return checked(model, path)


def checked(model, path):
    """With numbers that a scene can have."""
    camera = model.camera
    if not all(0 < value < 2**31 for value in (*camera[:2], camera.fx, camera.fy)):
        raise ImportFailed(f"{path}: the camera {camera[:6]} is invalid")
    if not all(
        isinstance(frame.number, int) and 0 <= frame.number <= LAST_FRAME for frame in model.frames
    ):
        raise ImportFailed(f"{path} has frame numbers that Blender does not support")
    if not all(0 < frame.zoom < math.inf for frame in model.frames):
        raise ImportFailed(f"{path} has invalid focal lengths")
    poses = [frame.world_from_blender for frame in model.frames]
    numbers = (camera[:6], poses, model.points, model.colours)
    if not all(np.isfinite(np.asarray(values, float)).all() for values in numbers):
        raise ImportFailed(f"{path} has numbers that are not finite")
    if model.fps is not None and not 0 < model.fps < 1e6:
        return model._replace(fps=None)
    return model


def read_model(path):
    if os.path.isfile(path):
        return read_transforms(path)
    if os.path.isfile(os.path.join(path, "cameras.txt")):
        # A model's world is its first camera; a scene's is upright.
        return upright(near(read_colmap(path, os.path.join(path, "trajectory.tum"), None)))
    sparse = os.path.join(path, "sparse", "0")
    if os.path.isfile(os.path.join(sparse, "cameras.txt")):
        trajectory = os.path.join(path, "model", "trajectory.tum")
        return read_colmap(sparse, trajectory, os.path.join(path, "images"))
    raise ImportFailed(
        f"{path} contains no model: give a folder with cameras.txt (cohort reconstruct, or colmap "
        "model_converter --output_type TXT), a scene of cohort sfm, or a transforms.json"
    )


def check_file(path):
    """A pipe or a device may never end."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise ImportFailed(f"cannot read {path}: it is not a file")


def data_lines(path):
    check_file(path)
    try:
        with open(path, encoding="utf-8") as lines:
            return [line.strip() for line in lines if not line.startswith("#")]
    except OSError as error:
        raise ImportFailed(f"cannot read {path}: {error.strerror}") from error


def read_colmap(folder, trajectory, images):
    try:
        return parse_colmap(folder, trajectory, images)
    except BAD as error:
        raise ImportFailed(f"{folder} is not a model in COLMAP's text format: {error!r}") from error


def parse_colmap(folder, trajectory, images):
    cameras = {}
    for line in filter(None, data_lines(os.path.join(folder, "cameras.txt"))):
        words = line.split()
        cameras[words[0]] = camera_of(words[1], words[2:], folder)

    frames = []
    used = []
    for line in image_lines(folder):
        words = split_image(line)
        cam_from_world = rigid(*(float(word) for word in words[1:8]))
        frames.append(Frame(int(words[0]), words[9], world_from_blender(cam_from_world)))
        used.append(cameras[words[8]])
    if not frames:
        raise ImportFailed(f"{folder} has no camera with a pose")
    camera, frames = with_one_camera(frames, used, folder)
    numbers = numbers_of(folder, {frame.number: frame.name for frame in frames})
    frames = [frame._replace(number=numbers[frame.number]) for frame in frames]
    frames.sort(key=lambda frame: frame.number)

    points = [
        line.split(maxsplit=7)[1:7]
        for line in filter(None, data_lines(os.path.join(folder, "points3D.txt")))
    ]
    table = np.array(points, float).reshape(-1, 6)
    return Model(
        camera, frames, table[:, :3], table[:, 3:], fps_of(trajectory), images
    )


def with_one_camera(frames, cameras, path):
    """The camera of the median focal length, and the frames with their zoom against it."""
    different = set(cameras)
    if len(different) == 1:
        return cameras[0], frames
    camera = sorted(cameras, key=lambda one: one.fx)[len(cameras) // 2]
    for other in different:
        same_but_focal = other._replace(fx=camera.fx, fy=camera.fy) == camera
        if not same_but_focal or not math.isclose(other.fy * camera.fx, other.fx * camera.fy):
            raise ImportFailed(
                f"{path} has {len(different)} different cameras: cohort's models have one, of which "
                "only the focal length may change"
            )
    zooms = [other.fx / camera.fx for other in cameras]
    return camera, [frame._replace(zoom=zoom) for frame, zoom in zip(frames, zooms)]


def numbers_of(folder, names):
    """The frame's number by the id of an image, of the images' `names` by their ids.

    cohort's images are numbered by frame, but not those of another program's model that it refined, of
    which summary.json has the frames. Ids that are not in the order of the names, as COLMAP gives them
    that works on several threads, are no frames: what is left are the numbers in the names, or else
    their order.
    """
    summary = os.path.join(folder, "summary.json")
    by_name = sorted(names, key=lambda image: natural(names[image]))
    if os.path.isfile(summary):
        with open(summary, encoding="utf-8") as file:
            frame_of_image = json.load(file).get("frame_of_image")
        if frame_of_image:
            return {image: frame + 1 for image, frame in frame_of_image}
    elif by_name != sorted(names):
        runs = {image: re.findall(r"\d+", names[image])[-1:] for image in by_name}
        numbers = {image: int(run[0]) for image, run in runs.items() if run}
        if len(set(numbers.values())) < len(names):
            return {image: i + 1 for i, image in enumerate(by_name)}
        first = min(numbers.values())
        return {image: number - first + 1 for image, number in numbers.items()}
    return {image: image for image in names}


def natural(name):
    """Runs of digits as numbers: frame2 comes before frame10."""
    return [(int(run), run) if run.isdecimal() else (-1, run) for run in re.split(r"(\d+)", name)]


def split_image(line):
    """id, rotation, translation, camera and name, which may hold spaces."""
    return line.split(maxsplit=9)


def image_lines(folder):
    """Of images.txt, two lines an image, the ones with the poses; the others may be empty."""
    lines = data_lines(os.path.join(folder, "images.txt"))
    first = next((i for i, line in enumerate(lines) if line), 0)
    return list(filter(None, lines[first::2]))


def camera_of(name, words, folder):
    """Of a line of cameras.txt: WIDTH HEIGHT PARAMS."""
    width, height, *parameters = (float(word) for word in words)
    one_focal = name.startswith(("SIMPLE_", "RADIAL"))
    fx, fy, cx, cy, *rest = parameters[:1] + parameters if one_focal else parameters
    if not (width > 0 and height > 0 and fx > 0 and fy > 0):
        raise ImportFailed(f"{folder}: the camera {name} {' '.join(words)} is invalid")
    distorted = "FISHEYE" in name or any(value != 0 for value in rest)
    return Camera(int(width), int(height), fx, fy, cx, cy, distorted)


def rigid(w, x, y, z, *translation):
    """4x4, of a quaternion and a translation."""
    w, x, y, z = np.array([w, x, y, z]) / math.sqrt(w * w + x * x + y * y + z * z)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = translation
    return matrix


def world_from_blender(cam_from_world):
    """COLMAP's camera looks along +z with y down, Blender's along -z with y up."""
    return np.linalg.inv(cam_from_world) @ np.diag([1.0, -1.0, -1.0, 1.0])


def nerfstudio_camera(intrinsics):
    return Camera(
        int(intrinsics["w"]),
        int(intrinsics["h"]),
        *(float(intrinsics[name]) for name in ("fl_x", "fl_y", "cx", "cy")),
        distorted=any(intrinsics.get(name, 0) for name in ("k1", "k2", "k3", "k4", "p1", "p2")),
    )


def read_transforms(path):
    """Nerfstudio's file; the points are a PLY of positions and colours."""
    try:
        with open(path, encoding="utf-8") as file:
            scene = json.load(file)
        # As Nerfstudio does: what stands beside the frames is of all of them.
        cameras = [nerfstudio_camera({**frame, **scene}) for frame in scene["frames"]]
        frames = [
            Frame(
                int(frame.get("colmap_im_id", i + 1)),
                frame["file_path"],
                np.array(frame["transform_matrix"], float).reshape(4, 4),
            )
            for i, frame in enumerate(scene["frames"])
        ]
    except BAD as error:
        raise ImportFailed(f"{path} is not a transforms.json with one camera: {error!r}") from error
    if not frames:
        raise ImportFailed(f"{path} has no frames")
    camera, frames = with_one_camera(frames, cameras, path)
    folder = os.path.dirname(path)
    numbers = numbers_of(folder, {frame.number: frame.name for frame in frames})
    frames = [frame._replace(number=numbers[frame.number]) for frame in frames]
    frames.sort(key=lambda frame: frame.number)
    points = colours = np.zeros((0, 3))
    if "ply_file_path" in scene:
        points, colours = read_ply(os.path.join(folder, scene["ply_file_path"]))
    fps = fps_of(os.path.join(folder, "model", "trajectory.tum"))
    return Model(camera, frames, points, colours, fps, os.path.join(folder, "images"))


def read_ply(path):
    check_file(path)
    try:
        with open(path, "rb") as file:
            head, _, body = file.read().partition(b"end_header\n")
    except OSError as error:
        raise ImportFailed(f"cannot read {path}: {error.strerror}") from error
    lines = [line.split() for line in head.splitlines()]
    same = {b"float32": b"float", b"uint8": b"uchar"}
    properties = [(same.get(line[1], line[1]), line[2]) for line in lines if line[:1] == [b"property"]]
    floats = [(b"float", name) for name in (b"x", b"y", b"z")]
    bytes_ = [(b"uchar", name) for name in (b"red", b"green", b"blue")]
    form = [line[1] for line in lines if line[:1] == [b"format"]]
    if properties == floats + bytes_ and form == [b"binary_little_endian"]:
        table = np.frombuffer(body, [("xyz", "<f4", 3), ("rgb", "u1", 3)])
        return table["xyz"].astype(float), table["rgb"].astype(float)
    if properties == floats + bytes_ and form == [b"ascii"]:  # Nerfstudio's own
        table = np.array(body.split(), float).reshape(-1, 6)
        return table[:, :3], table[:, 3:]
    raise ImportFailed(f"{path} is not a PLY of x, y, z and red, green, blue, as cohort and Nerfstudio write it")


def fps_of(trajectory):
    """Frames a second of the clip, of the times in a model's trajectory.tum; None without."""
    folder = os.path.dirname(trajectory)
    if not all(os.path.isfile(path) for path in (trajectory, os.path.join(folder, "images.txt"))):
        return None
    times = [float(line.split()[0]) for line in data_lines(trajectory) if line]
    # Of the clip, of which the tracks may have every n-th frame, and the model fewer.
    names = {int(words[0]): words[9] for words in map(split_image, image_lines(folder))}
    numbers = sorted(numbers_of(folder, names).values())
    if len(times) != len(numbers):
        return None
    steps = np.stack([np.diff(times), np.diff(numbers)])
    seconds, frames = steps[:, (steps > 0).all(axis=0)]
    return float(np.median(frames / seconds)) if seconds.size else None


def near(model):
    """The same about the middle of the cameras, where that is so far from the origin, as on a map, that
    Blender's numbers, of seven digits, are too few."""
    middle = np.mean([frame.world_from_blender[:3, 3] for frame in model.frames], axis=0)
    if np.linalg.norm(middle) < 1000 * distance_of(model):
        return model
    shift = np.eye(4)
    shift[:3, 3] = -middle
    frames = [
        frame._replace(world_from_blender=shift @ frame.world_from_blender)
        for frame in model.frames
    ]
    return model._replace(frames=frames, points=model.points - middle)


def upright(model):
    """The same with the cameras' mean upward direction along +z."""
    up = sum(frame.world_from_blender[:3, 1] for frame in model.frames)
    length = np.linalg.norm(up)
    if length < 1e-9:
        return model
    up = up / length
    # The smallest rotation; of a camera upside down, half a turn about x.
    axis = np.cross(up, [0.0, 0.0, 1.0])
    cosine = up[2]
    turn = np.eye(4)
    if cosine < -1.0 + 1e-12:
        turn = np.diag([1.0, -1.0, -1.0, 1.0])
    else:
        x, y, z = axis
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turn[:3, :3] = np.eye(3) + cross + cross @ cross / (1.0 + cosine)
    frames = [
        frame._replace(world_from_blender=turn @ frame.world_from_blender) for frame in model.frames
    ]
    return model._replace(frames=frames, points=model.points @ turn[:3, :3].T)


def lens_of(camera):
    """Blender's camera with the sensor fitted to the width: shifts are in widths of the picture."""
    aspect = camera.fx / camera.fy
    return Lens(
        focal_mm=camera.fx * SENSOR_WIDTH_MM / camera.width,
        shift_x=(camera.width / 2 - camera.cx) / camera.width,
        shift_y=(camera.cy - camera.height / 2) * aspect / camera.width,
        aspect=aspect,
    )


def distance_of(model):
    """How far the points are from the cameras, as a rule."""
    if not len(model.points):
        return 1.0
    middle = np.mean([frame.world_from_blender[:3, 3] for frame in model.frames], axis=0)
    return float(np.median(np.linalg.norm(model.points - middle, axis=1))) or 1.0


def points_as_mesh(points, colours, size):
    """Vertices, faces and a colour (0 to 1, linear) a vertex: a tetrahedron a point, `size` across, so
    that it is seen and rendered; of size 0 bare vertices."""
    linear = colours / 255.0
    linear = np.where(linear <= 0.04045, linear / 12.92, ((linear + 0.055) / 1.055) ** 2.4)
    if size <= 0:
        return points, np.zeros((0, 3), int), linear
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * (size / 2)
    sides = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    vertices = (points[:, None] + corners).reshape(-1, 3)
    faces = (4 * np.arange(len(points))[:, None, None] + sides).reshape(-1, 3)
    return vertices, faces, np.repeat(linear, 4, axis=0)


try:
    import bpy
except ImportError:  # read and tested without Blender
    bpy = None


def load(context, model, point_size):
    """Adds the camera and the points to the scene. `point_size` as a share of their distance."""
    from mathutils import Matrix

    scene = context.scene
    lens = lens_of(model.camera)
    distance = distance_of(model)

    scene.render.resolution_x = model.camera.width
    scene.render.resolution_y = model.camera.height
    scene.render.resolution_percentage = 100
    scene.render.pixel_aspect_x = max(1.0, 1.0 / lens.aspect)
    scene.render.pixel_aspect_y = max(1.0, lens.aspect)
    scene.frame_start = model.frames[0].number
    scene.frame_end = model.frames[-1].number
    if model.fps:
        scene.render.fps = max(1, round(model.fps))
        scene.render.fps_base = scene.render.fps / model.fps

    data = bpy.data.cameras.new("cohort camera")
    data.sensor_fit = "HORIZONTAL"
    data.sensor_width = SENSOR_WIDTH_MM
    data.lens = lens.focal_mm
    data.shift_x = lens.shift_x
    data.shift_y = lens.shift_y
    data.clip_start = distance / 1000
    data.clip_end = distance * 1000
    data.display_size = distance / 10
    add_background(data, model)
    camera = bpy.data.objects.new("cohort camera", data)
    scene.collection.objects.link(camera)
    scene.camera = camera

    camera.rotation_mode = "QUATERNION"
    before = None
    zooms = any(frame.zoom != 1.0 for frame in model.frames)
    for frame in model.frames:
        pose = Matrix(frame.world_from_blender.tolist())
        rotation = pose.to_quaternion()
        if before is not None and rotation.dot(before) < 0:
            rotation.negate()  # the same, but no turn of 360 degrees on the way
        before = rotation
        camera.location = pose.to_translation()
        camera.rotation_quaternion = rotation
        camera.keyframe_insert("location", frame=frame.number)
        camera.keyframe_insert("rotation_quaternion", frame=frame.number)
        if zooms:
            data.lens = lens.focal_mm * frame.zoom
            data.keyframe_insert("lens", frame=frame.number)
    scene.frame_set(scene.frame_start)

    if len(model.points):
        scene.collection.objects.link(points_object(model, point_size * distance))


def add_background(data, model):
    """The pictures of a scene behind what its camera sees, for those of its frames that it has."""
    names = sorted(os.listdir(model.images)) if model.images and os.path.isdir(model.images) else []
    first = model.frames[0]
    name = os.path.basename(first.name)
    if name not in names or not os.path.isfile(os.path.join(model.images, name)):
        return
    image = bpy.data.images.load(os.path.join(model.images, name), check_existing=True)
    image.source = "SEQUENCE"
    background = data.background_images.new()
    background.image = image
    user = background.image_user
    user.frame_start = first.number
    user.frame_duration = model.frames[-1].number - first.number + 1
    # Blender shows file number frame - frame_start + 1 + frame_offset.
    digits = re.findall(r"\d+", os.path.splitext(name)[0])
    user.frame_offset = int(digits[-1] if digits else 0) - 1
    data.show_background_images = True


def points_object(model, size):
    vertices, faces, colours = points_as_mesh(model.points, model.colours, size)
    mesh = bpy.data.meshes.new("cohort points")
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    attribute = mesh.attributes.new("colour", "FLOAT_COLOR", "POINT")
    attribute.data.foreach_set("color", np.insert(colours, 3, 1.0, axis=1).ravel())

    material = bpy.data.materials.new("cohort points")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    colour = nodes.new("ShaderNodeAttribute")
    colour.attribute_name = "colour"
    light = nodes.new("ShaderNodeEmission")
    output = nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(colour.outputs["Color"], light.inputs["Color"])
    material.node_tree.links.new(light.outputs["Emission"], output.inputs["Surface"])
    mesh.materials.append(material)
    return bpy.data.objects.new("cohort points", mesh)


POINT_SIZE = 0.003
DISTORTED = "the lens distortion is left out: `cohort sfm` writes scenes with undistorted pictures"

if bpy is not None:

    class IMPORT_SCENE_OT_cohort(bpy.types.Operator):
        """Load the camera and the points of a model or scene of cohort"""

        bl_idname = "import_scene.cohort"
        bl_label = "Import cohort"
        bl_options = {"REGISTER", "UNDO"}

        directory: bpy.props.StringProperty(subtype="DIR_PATH")
        filepath: bpy.props.StringProperty(subtype="FILE_PATH")
        filter_glob: bpy.props.StringProperty(default="*.json;*.txt", options={"HIDDEN"})
        point_size: bpy.props.FloatProperty(
            name="Point size",
            description="Size of the points, as a share of their distance; 0: bare vertices",
            default=POINT_SIZE,
            min=0.0,
            max=0.1,
        )

        def invoke(self, context, event):
            context.window_manager.fileselect_add(self)
            return {"RUNNING_MODAL"}

        def execute(self, context):
            is_file = self.filepath.endswith(".json")
            try:
                model = read(self.filepath if is_file else self.directory or self.filepath)
                load(context, model, self.point_size)
            except ImportFailed as error:
                self.report({"ERROR"}, str(error))
                return {"CANCELLED"}
            if model.camera.distorted:
                self.report({"WARNING"}, DISTORTED)
            return {"FINISHED"}

    def menu_entry(self, context):
        self.layout.operator(IMPORT_SCENE_OT_cohort.bl_idname, text="cohort model or scene")

    def register():
        bpy.utils.register_class(IMPORT_SCENE_OT_cohort)
        bpy.types.TOPBAR_MT_file_import.append(menu_entry)

    def unregister():
        bpy.types.TOPBAR_MT_file_import.remove(menu_entry)
        bpy.utils.unregister_class(IMPORT_SCENE_OT_cohort)


def main():
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    if not 1 <= len(arguments) <= 2:
        sys.exit("usage: blender --python import_cohort.py -- MODEL [OUT.blend]")
    try:
        model = read(arguments[0])
    except ImportFailed as error:
        sys.exit(f"import_cohort: error: {error}")
    for name in ("Cube", "Light", "Camera"):  # of Blender's first scene
        if name in bpy.data.objects:
            bpy.data.objects.remove(bpy.data.objects[name])
    load(bpy.context, model, POINT_SIZE)
    if model.camera.distorted:
        print(f"import_cohort: warning: {DISTORTED}", file=sys.stderr)
    if len(arguments) > 1:
        bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath(arguments[1]))


if __name__ == "__main__" and bpy is not None:
    main()
