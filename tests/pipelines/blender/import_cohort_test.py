"""The Blender add-on: its reading and geometry in plain Python, and all of it in the real Blender."""

import importlib.util
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy as np

PROGRAM = os.environ["COHORT_PROGRAM"]
ADD_ON = pathlib.Path(os.environ["COHORT_SOURCE_DIR"]) / "pipelines/blender/import_cohort.py"

spec = importlib.util.spec_from_file_location("import_cohort", ADD_ON)
import_cohort = importlib.util.module_from_spec(spec)
spec.loader.exec_module(import_cohort)


def run(*arguments):
    subprocess.run([PROGRAM, *map(str, arguments), "--quiet"], check=True, capture_output=True)


def observations(folder):
    """(image id, row of points3D.txt, x, y) of all images."""
    ids = [line.split()[0] for line in import_cohort.data_lines(folder / "points3D.txt") if line]
    row_of = {point: row for row, point in enumerate(ids)}
    lines = import_cohort.data_lines(folder / "images.txt")
    for pose, positions in zip(lines[::2], lines[1::2]):
        words = positions.split()
        for x, y, point in zip(words[::3], words[1::3], words[2::3]):
            yield int(pose.split()[0]), row_of[point], float(x), float(y)


def blender_pixels(camera, frame, points):
    """Where Blender's camera sees points: its view plane is one wide, at the distance lens / sensor,
    moved by the shifts; a pixel is `aspect` times as tall as it is wide."""
    lens = import_cohort.lens_of(camera)
    focal_mm = lens.focal_mm * frame.zoom
    x, y, z, _ = np.linalg.inv(frame.world_from_blender) @ np.insert(points, 3, 1.0, axis=1).T
    plane = focal_mm / import_cohort.SENSOR_WIDTH_MM / -z
    return np.stack(
        [
            camera.width * (0.5 + x * plane - lens.shift_x),
            camera.height / 2 - camera.width / lens.aspect * (y * plane - lens.shift_y),
        ],
        axis=1,
    )


def errors_px(model, folder):
    frames = {frame.number: frame for frame in model.frames}
    errors = []
    for number, row, x, y in observations(folder):
        pixel = blender_pixels(model.camera, frames[number], model.points[row : row + 1])[0]
        errors.append(np.hypot(*(pixel - [x, y])))
    return np.array(errors)


class WrittenByHand(unittest.TestCase):
    """A camera with all that can go wrong: oblong pixels, an axis off the middle, any direction."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.dir = pathlib.Path(folder.name)
        write_by_hand(self.dir)

    def test_points_are_where_they_were_observed(self):
        model = import_cohort.read(self.dir)
        self.assertEqual([frame.number for frame in model.frames], [1, 2, 5, 9])
        self.assertEqual(model.frames[2].name, "5 a b.png")
        errors = errors_px(model, self.dir)
        self.assertEqual(len(errors), 80)
        self.assertLess(errors.max(), 1e-9)
        self.assertIsNone(model.fps)
        self.assertFalse(model.camera.distorted)

    def test_points_of_a_zoom_are_where_they_were_observed(self):
        write_by_hand(self.dir, zooms=ZOOMS)
        model = import_cohort.read(self.dir)
        zooms = [frame.zoom for frame in model.frames]
        np.testing.assert_allclose(zooms, np.array([0.8, 1.0, 1.2, 1.5]) / 1.2)
        self.assertLess(errors_px(model, self.dir).max(), 1e-9)
        # A lens that is not of the others.
        path = self.dir / "cameras.txt"
        path.write_text(path.read_text().replace(" 270.5 ", " 271.5 ", 1))
        with self.assertRaisesRegex(import_cohort.ImportFailed, "only the focal length may change"):
            import_cohort.read(self.dir)

    def test_a_transforms_json_has_the_focal_length_of_every_frame(self):
        frames = [
            {"file_path": f"images/{i}.jpg", "transform_matrix": np.eye(4).tolist()}
            | {"w": 640, "h": 480, "fl_x": 500.0 + i, "fl_y": 500.0 + i, "cx": 320.0, "cy": 240.0}
            for i in range(3)
        ]
        path = self.dir / "transforms.json"
        path.write_text(json.dumps({"k1": 0.0, "frames": frames}))
        model = import_cohort.read(path)
        self.assertEqual(model.camera.fx, 501.0)
        focals = [frame.zoom * model.camera.fx for frame in model.frames]
        np.testing.assert_allclose(focals, [500.0, 501.0, 502.0])
        # Nerfstudio takes what is written for all frames.
        intrinsics = {name: frames[0][name] for name in ("w", "h", "fl_x", "fl_y", "cx", "cy")}
        path.write_text(json.dumps({**intrinsics, "frames": frames}))
        self.assertEqual({frame.zoom for frame in import_cohort.read(path).frames}, {1.0})

    def test_frames_a_second_are_the_clips(self):
        times = {number: number / 25 for number in (1, 2, 5, 9)}
        trajectory = "".join(f"{time} 0 0 0 0 0 0 1\n" for time in times.values())
        (self.dir / "trajectory.tum").write_text(trajectory)
        self.assertAlmostEqual(import_cohort.read(self.dir).fps, 25)
        # A scene has fewer frames than its model.
        sparse, model = self.dir / "scene/sparse/0", self.dir / "scene/model"
        for folder in (sparse, model):
            folder.mkdir(parents=True)
            write_by_hand(folder)
        (model / "trajectory.tum").write_text(trajectory)
        lines = (sparse / "images.txt").read_text().splitlines()
        (sparse / "images.txt").write_text("\n".join(lines[:3] + lines[-2:]) + "\n")
        scene = import_cohort.read(self.dir / "scene")
        self.assertEqual([frame.number for frame in scene.frames], [5, 9])
        self.assertAlmostEqual(scene.fps, 25)
        (model / "trajectory.tum").write_text(trajectory[:20])
        self.assertIsNone(import_cohort.read(self.dir / "scene").fps)

    def test_images_of_another_programs_order_are_in_the_clips(self):
        lines = (self.dir / "images.txt").read_text()
        for was, name in (("1.png", 10), ("2.png", 9), ("5 a b.png", 1), ("9.png", 2)):
            lines = lines.replace(f" {was}\n", f" name {name}\n")  # as COLMAP's threads leave them
        (self.dir / "images.txt").write_text(lines)
        frames = import_cohort.read(self.dir).frames
        self.assertEqual([frame.name for frame in frames], ["name 1", "name 2", "name 9", "name 10"])
        self.assertEqual([frame.number for frame in frames], [1, 2, 9, 10])
        # cohort's own, of a clip whose pictures are listed in such an order.
        (self.dir / "summary.json").write_text("{}")
        self.assertEqual([frame.number for frame in import_cohort.read(self.dir).frames], [1, 2, 5, 9])
        # What cohort refined says which frames they are.
        of_image = [[1, 13], [2, 12], [5, 4], [9, 5]]
        (self.dir / "summary.json").write_text(json.dumps({"frame_of_image": of_image}))
        times = "".join(f"{frame / 25} 0 0 0 0 0 0 1\n" for frame in (4, 5, 12, 13))
        (self.dir / "trajectory.tum").write_text(times)
        model = import_cohort.read(self.dir)
        self.assertEqual([frame.number for frame in model.frames], [5, 6, 13, 14])
        self.assertEqual(model.frames[0].name, "name 1")
        self.assertAlmostEqual(model.fps, 25)

    def test_a_world_on_a_map_comes_near(self):
        here = import_cohort.read(self.dir)
        far = import_cohort.Model(*here)
        shift = np.eye(4)
        shift[:3, 3] = [456789, 5412345, 312]
        far = far._replace(
            frames=[f._replace(world_from_blender=shift @ f.world_from_blender) for f in far.frames],
            points=far.points + shift[:3, 3],
        )
        near = import_cohort.near(far)
        middle = np.mean([frame.world_from_blender[:3, 3] for frame in near.frames], axis=0)
        self.assertLess(np.linalg.norm(middle), 1e-6)
        before = np.linalg.norm(here.points - here.frames[0].world_from_blender[:3, 3], axis=1)
        after = np.linalg.norm(near.points - near.frames[0].world_from_blender[:3, 3], axis=1)
        np.testing.assert_allclose(after, before, atol=1e-6)
        self.assertIs(import_cohort.near(here), here)

    def test_the_world_is_turned_upright(self):
        model = import_cohort.read(self.dir)
        up = sum(frame.world_from_blender[:3, 1] for frame in model.frames)
        np.testing.assert_allclose(up / np.linalg.norm(up), [0, 0, 1], atol=1e-12)
        for frame in model.frames:
            rotation = frame.world_from_blender[:3, :3]
            np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
            self.assertGreater(np.linalg.det(rotation), 0)

    def test_all_of_colmaps_cameras_are_read(self):
        for line, focal, distorted in (
            ("1 SIMPLE_PINHOLE 640 480 500 320 240", (500, 500), False),
            ("1 SIMPLE_RADIAL 640 480 500 320 240 0", (500, 500), False),
            ("1 RADIAL 640 480 500 320 240 0.1 0", (500, 500), True),
            ("1 OPENCV 640 480 500 510 320 240 0 0 0 0.1", (500, 510), True),
            ("1 OPENCV_FISHEYE 640 480 500 510 320 240 0 0 0 0", (500, 510), True),
        ):
            with self.subTest(line):
                (self.dir / "cameras.txt").write_text(line + "\n")
                camera = import_cohort.read(self.dir).camera
                self.assertEqual((camera.fx, camera.fy), focal)
                self.assertEqual((camera.cx, camera.cy), (320, 240))
                self.assertEqual(camera.distorted, distorted)

    def test_errors_say_what_and_where(self):
        with self.assertRaisesRegex(import_cohort.ImportFailed, "no_such contains no model: give"):
            import_cohort.read(self.dir / "no_such")
        (self.dir / "transforms.json").write_text("[1]")
        with self.assertRaisesRegex(import_cohort.ImportFailed, "is not a transforms.json"):
            import_cohort.read(self.dir / "transforms.json")
        (self.dir / "cameras.txt").write_text("1 PINHOLE 640 480 here\n")
        with self.assertRaisesRegex(import_cohort.ImportFailed, "not a model in COLMAP's text format"):
            import_cohort.read(self.dir)
        (self.dir / "cameras.txt").unlink()
        pose = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
        scene = {"w": 6, "h": 4, "fl_x": 5, "fl_y": 5, "cx": 3, "cy": 2,
                 "frames": [{"file_path": "a", "transform_matrix": pose}]}
        for changed in ({"w": 0}, {"w": float("inf")}, {"fl_x": float("nan")}, {"frames": {"a": 1}},
                        {"frames": [{**scene["frames"][0], "colmap_im_id": 2**40}]},
                        {"ply_file_path": 5}, {"ply_file_path": "/dev/zero"},
                        {"frames": [{"file_path": "a", "transform_matrix": [float("nan")] * 16}]}):
            (self.dir / "transforms.json").write_text(json.dumps({**scene, **changed}))
            with self.assertRaises(import_cohort.ImportFailed, msg=str(changed)):
                import_cohort.read(self.dir / "transforms.json")
        (self.dir / "transforms.json").write_text(json.dumps(scene))
        import_cohort.read(self.dir / "transforms.json")
        write_by_hand(self.dir)
        images = (self.dir / "images.txt").read_text()
        (self.dir / "images.txt").write_text("\n" * 1_000_000 + images)
        self.assertEqual(len(import_cohort.read(self.dir).frames), 4)
        (self.dir / "points3D.txt").unlink()
        with self.assertRaisesRegex(import_cohort.ImportFailed, "cannot read .*points3D.txt: No"):
            import_cohort.read(self.dir)
        os.mkfifo(self.dir / "points3D.txt")
        with self.assertRaisesRegex(import_cohort.ImportFailed, "points3D.txt: it is not a file"):
            import_cohort.read(self.dir)

    def test_points_become_a_coloured_mesh(self):
        points = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
        colours = np.array([[255, 0, 128], [0, 10, 0]])
        vertices, faces, shown = import_cohort.points_as_mesh(points, colours, 0.1)
        self.assertEqual((vertices.shape, faces.shape, shown.shape), ((8, 3), (8, 3), (8, 3)))
        np.testing.assert_allclose(vertices.reshape(2, 4, 3).mean(axis=1), points)
        np.testing.assert_allclose(np.ptp(vertices[:4], axis=0), 0.1)
        np.testing.assert_allclose(shown[0], [1, 0, 0.2159], atol=1e-4)
        # The sides look outward.
        for face in faces:
            a, b, c = vertices[face]
            self.assertGreater(np.cross(b - a, c - a) @ (a - points[face[0] // 4]), 0)
        vertices, faces, shown = import_cohort.points_as_mesh(points, colours, 0)
        np.testing.assert_array_equal(vertices, points)
        self.assertEqual((len(faces), len(shown)), (0, 2))


ZOOMS = {1: 0.8, 2: 1.0, 5: 1.2, 9: 1.5}  # of the images


def write_by_hand(folder, zooms=None):
    random = np.random.default_rng(1)
    fx, fy, cx, cy = 500.0, 620.0, 270.5, 290.25
    points = random.uniform(-1, 1, (20, 3))
    cameras = {1: 1.0} if zooms is None else zooms
    images = []
    for number, name in ((9, "9.png"), (1, "1.png"), (2, "2.png"), (5, "5 a b.png")):
        quaternion = random.normal(size=4)
        pose = import_cohort.rigid(*quaternion, *random.uniform(-0.3, 0.3, 2), 5.0)
        x, y, z = pose[:3, :3] @ points.T + pose[:3, 3:]
        camera = 1 if zooms is None else number
        zoom = cameras[camera]
        seen = zip(zoom * fx * x / z + cx, zoom * fy * y / z + cy, range(1, 21))
        numbers = [*quaternion, *pose[:3, 3]]
        images.append(f"{number} {' '.join(map(repr, map(float, numbers)))} {camera} {name}")
        images.append(" ".join(f"{float(u)!r} {float(v)!r} {i}" for u, v, i in seen))
    lines = [f"{i} PINHOLE 640 480 {zoom * fx} {zoom * fy} {cx} {cy}\n" for i, zoom in cameras.items()]
    (folder / "cameras.txt").write_text("# a comment\n" + "".join(lines))
    (folder / "images.txt").write_text("# a comment\n" + "\n".join(images) + "\n")
    (folder / "points3D.txt").write_text(
        "".join(
            f"{i} {' '.join(repr(float(c)) for c in point)} {i} 20 30 0.1\n"
            for i, point in enumerate(points, 1)
        )
    )


class WrittenByCohort(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.dir = pathlib.Path(folder.name)
        clip = cls.dir / "clip"
        run("synth", clip, "--motion", "lateral", "--frames", "16")
        run("sfm", clip, "--out", cls.dir / "scene", "--features", "200", "--min-motion", "0")

    def test_a_model_fits_its_observations(self):
        folder = self.dir / "scene/model"
        model = import_cohort.read(folder)
        self.assertEqual([frame.number for frame in model.frames], list(range(1, 17)))
        self.assertAlmostEqual(model.fps, 30.0, places=3)
        errors = errors_px(model, folder)
        self.assertGreater(len(errors), 1000)
        self.assertLess(np.median(errors), 0.1)
        self.assertLess(errors.max(), 3.0)

    def test_a_scene_fits_its_observations(self):
        model = import_cohort.read(self.dir / "scene")
        self.assertEqual(len(model.frames), 16)
        self.assertAlmostEqual(model.fps, 30.0, places=3)
        self.assertLess(np.median(errors_px(model, self.dir / "scene/sparse/0")), 0.1)
        self.assertTrue(os.path.isdir(model.images))

    def test_transforms_json_is_the_same_scene(self):
        scene = import_cohort.read(self.dir / "scene")
        same = import_cohort.read(self.dir / "scene/transforms.json")
        self.assertEqual(same.camera, scene.camera)
        self.assertEqual(same.fps, scene.fps)
        self.assertEqual([f.number for f in same.frames], [f.number for f in scene.frames])
        for a, b in zip(same.frames, scene.frames):
            np.testing.assert_allclose(a.world_from_blender, b.world_from_blender, atol=1e-9)
        np.testing.assert_allclose(same.points, scene.points, rtol=1e-5, atol=1e-5)
        np.testing.assert_array_equal(same.colours, scene.colours)


    def test_a_transforms_json_of_nerfstudios_own(self):
        """Points as text, types by their other names, images numbered as COLMAP's threads came to them."""
        folder = self.dir / "nerfstudio"
        folder.mkdir()
        scene = json.loads((self.dir / "scene/transforms.json").read_text())
        scene["frames"] = scene["frames"][:3]
        for number, frame in zip((2, 1, 3), scene["frames"]):
            frame["colmap_im_id"] = number
        scene["ply_file_path"] = "sparse_pc.ply"
        (folder / "transforms.json").write_text(json.dumps(scene))
        names = "".join(f"property uint8 {name}\n" for name in ("red", "green", "blue"))
        (folder / "sparse_pc.ply").write_text(
            "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
            f"property float z\n{names}end_header\n1 2.5 3 10 20 30\n-1 0 1e1 255 0 7\n"
        )
        model = import_cohort.read(folder / "transforms.json")
        self.assertEqual([frame.number for frame in model.frames], [1, 2, 3])
        self.assertEqual(
            [frame.name for frame in model.frames], [frame["file_path"] for frame in scene["frames"]]
        )
        np.testing.assert_array_equal(model.points, [[1, 2.5, 3], [-1, 0, 10]])
        np.testing.assert_array_equal(model.colours, [[10, 20, 30], [255, 0, 7]])
        # A picture that found no place leaves its number free.
        for name, frame in zip((4, 5, 7), scene["frames"]):
            frame["file_path"] = f"images/frame_{name:05}.png"
        (folder / "transforms.json").write_text(json.dumps(scene))
        model = import_cohort.read(folder / "transforms.json")
        self.assertEqual([frame.number for frame in model.frames], [1, 2, 4])
        for name, frame in zip("abc", scene["frames"]):
            frame["file_path"] = f"images/{name}.png"
        (folder / "transforms.json").write_text(json.dumps(scene))
        model = import_cohort.read(folder / "transforms.json")
        self.assertEqual([frame.number for frame in model.frames], [1, 2, 3])


# Runs in Blender: what is loaded is where Blender itself says that it is.
IN_BLENDER = """
import sys
sys.path.insert(0, sys.argv[-1])
import pathlib
import bpy
import numpy as np
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
import import_cohort_test as test

folder = pathlib.Path(sys.argv[-2])
sparse = folder / "sparse/0" if (folder / "sparse/0").exists() else folder
bpy.ops.preferences.addon_install(filepath=str(test.ADD_ON))
bpy.ops.preferences.addon_enable(module="import_cohort")
assert bpy.ops.import_scene.cohort(directory=str(folder)) == {"FINISHED"}
scene = bpy.context.scene
mesh = bpy.data.objects["cohort points"].data
points = np.array([v.co for v in mesh.vertices]).reshape(-1, 4, 3).mean(axis=1)
errors = []
for number, row, x, y in test.observations(sparse):
    if scene.frame_current != number:
        scene.frame_set(number)
    at = world_to_camera_view(scene, scene.camera, Vector(points[row]))
    width, height = scene.render.resolution_x, scene.render.resolution_y
    errors.append(np.hypot(at.x * width - x, (1 - at.y) * height - y))
colours = np.zeros(len(mesh.vertices) * 4)
mesh.attributes["colour"].data.foreach_get("color", colours)
assert 0 < colours.reshape(-1, 4)[:, :3].mean() < 1, colours
print("ERRORS", len(errors), float(np.median(errors)), float(np.max(errors)))
print("FRAMES", scene.frame_start, scene.frame_end, round(scene.render.fps / scene.render.fps_base))
for background in scene.camera.data.background_images:
    print("BACKGROUND", background.image.filepath)
"""


@unittest.skipUnless(shutil.which("blender"), "no blender")
class InBlender(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.dir = pathlib.Path(folder.name)

    def blender(self, *arguments):
        return subprocess.run(
            ["blender", "--background", "--factory-startup", "--python-exit-code", "3", "--python"]
            + [str(word) for word in arguments],
            capture_output=True,
            text=True,
            env={**os.environ, "HOME": str(self.dir)},
        )

    def loaded(self, folder):
        script = self.dir / "check.py"
        script.write_text(IN_BLENDER)
        end = self.blender(script, "--", folder, pathlib.Path(__file__).parent)
        self.assertEqual(end.returncode, 0, end.stdout + end.stderr)
        lines = [line.split() for line in end.stdout.splitlines()]
        return {words[0]: words[1:] for words in lines if words and words[0].isupper()}

    def test_points_are_where_they_were_observed(self):
        model = self.dir / "model"
        model.mkdir()
        write_by_hand(model)
        said = self.loaded(model)
        count, _, largest = map(float, said["ERRORS"])
        self.assertEqual(count, 80)
        self.assertLess(largest, 0.01)  # of 32 bits
        self.assertEqual(said["FRAMES"][:2], ["1", "9"])

    def test_a_zoom_turns_the_lens(self):
        model = self.dir / "model"
        model.mkdir()
        write_by_hand(model, zooms=ZOOMS)
        self.assertLess(float(self.loaded(model)["ERRORS"][2]), 0.01)

    def test_a_scene_is_loaded_and_saved(self):
        clip = self.dir / "clip"
        run("synth", clip, "--motion", "lateral", "--frames", "16")
        run("sfm", clip, "--out", self.dir / "scene", "--features", "200", "--min-motion", "0")
        said = self.loaded(self.dir / "scene")
        self.assertLess(float(said["ERRORS"][1]), 0.1)
        self.assertEqual(said["FRAMES"], ["1", "16", "30"])
        self.assertTrue(said["BACKGROUND"][0].endswith("000000.jpg"))
        end = self.blender(ADD_ON, "--", self.dir / "scene", self.dir / "out.blend")
        self.assertEqual(end.returncode, 0, end.stderr)
        self.assertTrue((self.dir / "out.blend").exists())

    def test_errors_end_it(self):
        end = self.blender(ADD_ON, "--", self.dir / "none", self.dir / "out.blend")
        self.assertEqual(end.returncode, 1)
        self.assertIn("import_cohort: error: ", end.stderr)
        self.assertFalse((self.dir / "out.blend").exists())


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
