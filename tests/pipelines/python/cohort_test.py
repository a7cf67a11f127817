"""The package cohort, as a user's Python has it."""

import json
import os
import pathlib
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import numpy as np

import cohort

PROGRAM = os.environ["COHORT_PROGRAM"]
SOURCE = pathlib.Path(os.environ["COHORT_SOURCE_DIR"])
EXAMPLE = SOURCE / "pipelines/python/examples/clip_to_cameras.py"
CAMERA = "260,260,159.5,119.5"
FEW = {"max_features": 150}
ONE_PASS = {"mode": "off"}


def run(*arguments):
    return subprocess.run(
        [PROGRAM, *map(str, arguments)], check=True, capture_output=True, text=True
    )


class Clip(unittest.TestCase):
    """A rendered clip as files, what the program makes of it, and its frames as arrays."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.dir = pathlib.Path(cls.folder.name)
        run("synth", cls.dir / "clip", "--frames", 20, "--width-px", 320, "--height-px", 240,
            "--focal-px", 260)
        run("track", cls.dir / "clip", "--features", 150, "--camera", CAMERA,
            "--out", cls.dir / "program.tracks")
        cls.program_tracks = cohort.Tracks.read(cls.dir / "program.tracks")
        cls.frames = read_frames(cls.dir / "clip/rgb")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def expect_same(self, a, b):
        for name in cohort.OBSERVATION.names:  # NaN is NaN by column alone
            np.testing.assert_array_equal(a.observations[name], b.observations[name], name)

    def expect_others(self, a, b):
        with self.assertRaises(AssertionError):
            self.expect_same(a, b)


def read_frames(folder):
    """The pictures of a folder of the renderer's, by ffmpeg."""
    raw = subprocess.run(
        ["ffmpeg", "-loglevel", "error", "-i", folder / "%06d.png", "-f", "rawvideo",
         "-pix_fmt", "gray", "-"],
        check=True,
        capture_output=True,
    ).stdout
    return list(np.frombuffer(raw, np.uint8).reshape(-1, 240, 320))


class Track(Clip):
    def test_a_path_gives_what_the_program_writes(self):
        tracks = cohort.track(self.dir / "clip", camera=CAMERA, detector=FEW)
        self.expect_same(tracks, self.program_tracks)
        self.assertEqual(tracks.meta, self.program_tracks.meta)
        self.assertEqual(tracks.ends, self.program_tracks.ends)
        self.assertEqual(tracks.frame_names, self.program_tracks.frame_names)

    def test_a_generator_of_frames_gives_the_same_tracks(self):
        asked = []

        def frames():
            for i, frame in enumerate(self.frames):
                asked.append((i, threading.current_thread() is threading.main_thread()))
                yield frame

        tracks = cohort.track(frames(), camera=[260, 260, 159.5, 119.5], detector=FEW)
        self.expect_same(tracks, self.program_tracks)
        self.assertEqual(tracks.meta["second_pass"], "done")
        self.assertEqual(asked, [(i, True) for i in range(20)])
        self.assertEqual(tracks.source, "")

    def test_a_list_and_one_array_are_clips_too(self):
        by_list = cohort.track(self.frames, detector=FEW, second_pass=ONE_PASS)
        by_array = cohort.track(np.stack(self.frames), detector=FEW, second_pass=ONE_PASS)
        self.assertEqual(len(by_list.frames), 20)
        self.expect_same(by_list, by_array)

    def test_colours_are_blue_green_red_unless_said_otherwise(self):
        noise = np.random.default_rng(0)
        bgr = [
            np.clip(f[:, :, None] * [0.5, 1.0, 0.8] + noise.integers(0, 9, 3), 0, 255).astype("u1")
            for f in self.frames[:5]
        ]
        options = dict(detector=FEW, tracker="klt")
        by_bgr = cohort.track(bgr, **options)
        by_rgb = cohort.track([f[:, :, ::-1] for f in bgr], channels="rgb", **options)
        self.expect_same(by_bgr, by_rgb)
        self.expect_others(by_bgr, cohort.track(bgr, channels="rgb", **options))

    def test_16_bits_are_kept(self):
        options = dict(detector=FEW, tracker="klt")
        eight = cohort.track(self.frames[:5], **options)
        sixteen = cohort.track([f.astype(np.uint16) * 257 for f in self.frames[:5]], **options)
        self.assertLess(abs(len(eight.track_ids) - len(sixteen.track_ids)), 15)

    def test_no_feature_where_the_mask_is_0(self):
        mask = np.ones((240, 320), bool)
        mask[:, :160] = False
        tracks = cohort.track(self.frames[:5], mask=mask, detector=FEW, tracker="klt")
        self.assertGreater(len(tracks.track_ids), 10)
        self.assertGreater(tracks.observations["x"].min(), 158)

    def test_fixed_parts_of_a_clip_are_noted_so_that_refine_masks_them_too(self):
        texture = np.kron(np.random.default_rng(5).integers(30, 220, (60, 60)), np.ones((6, 6)))
        with tempfile.TemporaryDirectory() as folder:
            for i in range(48):
                frame = texture[2 * i : 2 * i + 120, 3 * i : 3 * i + 160].astype(np.uint8)
                frame[90:] = 0
                (pathlib.Path(folder) / f"{i:03}.pgm").write_bytes(b"P5 160 120 255\n" + frame.tobytes())
            options = dict(detector=FEW, tracker="klt")
            tracks = cohort.track(folder, **options)
            unmasked = cohort.track(folder, mask_fixed=False, **options)
        self.assertEqual(tracks.meta["fixed_parts"], "masked")
        self.assertLess(tracks.observations["y"].max(), 90)
        self.assertEqual(unmasked.meta["fixed_parts"], "off")

    def test_progress_is_told_after_every_frame_and_may_end_the_work(self):
        told = []
        cohort.track(self.frames, progress=lambda *what: told.append(what), detector=FEW)
        self.assertIn(("track", 20, 20), told)
        self.assertEqual({stage for stage, _, _ in told}, {"look", "track", "learn", "measure"})

        class Enough(Exception):
            pass

        def end(stage, done, total):
            if done == 3:
                raise Enough

        with self.assertRaises(Enough):
            cohort.track(self.dir / "clip", progress=end)

    def test_other_python_threads_work_meanwhile(self):
        ticks = []
        stop = threading.Event()

        def tick():
            while not stop.wait(0.001):
                ticks.append(1)

        thread = threading.Thread(target=tick)
        thread.start()
        try:
            cohort.track(self.dir / "clip", detector=FEW, second_pass=ONE_PASS)
        finally:
            stop.set()
            thread.join()
        self.assertGreater(len(ticks), 20)

    def test_control_c_ends_it(self):
        for call in (
            "cohort.track(itertools.repeat(frame))",
            "cohort.track(itertools.repeat(frame), tracker='klt')",
        ):
            with self.subTest(call):
                self.assertIn("KeyboardInterrupt", interrupted(call))

    def test_errors_say_what_and_where(self):
        with self.assertRaisesRegex(cohort.Error, "no_such_clip"):
            cohort.track("no_such_clip")
        with self.assertRaisesRegex(cohort.UsageError, "unknown key detector.max_feature:"):
            cohort.track(self.frames, detector={"max_feature": 3})
        with self.assertRaisesRegex(cohort.UsageError, "detector.max_features = 0 is out of range"):
            cohort.track(self.frames, detector={"max_features": 0})
        with self.assertRaisesRegex(ValueError, "'fast' is unknown: give one of subspace"):
            cohort.track(self.frames, tracker="fast")
        with self.assertRaisesRegex(cohort.Error, "frame 0 has float64 pixels: give uint8"):
            cohort.track([np.zeros((9, 9))])
        with self.assertRaisesRegex(cohort.Error, r"frame 0 has the shape \(9, 9, 4\)"):
            cohort.track([np.zeros((9, 9, 4), np.uint8)])
        with self.assertRaisesRegex(cohort.Error, "frame 1 is a str"):
            cohort.track([self.frames[0], "frame"])
        with self.assertRaisesRegex(cohort.Error, "frame 1 is 9x9, the first frame is 320x240"):
            cohort.track([self.frames[0], np.zeros((9, 9), np.uint8)])
        with self.assertRaisesRegex(cohort.Error, "no frame to track"):
            cohort.track([])
        with self.assertRaisesRegex(TypeError, "not iterable"):
            cohort.track(7)
        with self.assertRaisesRegex(cohort.UsageError, "frames is for clips that are read"):
            cohort.track(self.frames, frames="0:3")
        with self.assertRaisesRegex(cohort.UsageError, "out is for the program only"):
            cohort.track(self.frames, out="f.tracks")
        with self.assertRaisesRegex(cohort.UsageError, "channels 'gbr'"):
            cohort.track(self.frames, channels="gbr")
        with self.assertRaisesRegex(ZeroDivisionError, "division"):
            cohort.track(frame if i < 3 else 1 // 0 for i, frame in enumerate(self.frames))

    def test_masks_are_0_or_not_of_any_type(self):
        mask = np.zeros((240, 320), np.uint16)
        mask[:, 160:] = 65535
        tracks = [cohort.track(self.frames[:3], mask=m, tracker="klt") for m in (mask, mask > 0)]
        self.expect_same(*tracks)
        self.assertGreater(len(tracks[0].track_ids), 0)
        self.assertGreaterEqual(tracks[0].observations["x"][tracks[0].observations["frame"] == 0].min(), 159)

    def test_a_camera_is_of_the_clips_pictures_and_may_be_a_guess(self):
        numbers = [260, 260, 159.5, 119.5]
        guess = cohort.Camera(320, 240, numbers, known=False)
        self.assertFalse(cohort.track(self.frames[:3], camera=guess, tracker="klt").camera.known)
        seen = []
        with self.assertRaisesRegex(cohort.Error, "640x480, but these are 320x240"):
            cohort.track((seen.append(f) or f for f in self.frames), tracker="klt",
                         camera=cohort.Camera(640, 480, numbers))
        self.assertEqual(len(seen), 1, "before all the work")

    def test_a_prior_of_the_focal_length_is_a_guess_with_its_uncertainty(self):
        camera = cohort.track(self.frames[:3], tracker="klt", camera_prior="260+-26").camera
        self.assertEqual((camera.known, camera.fx, camera.guess_log_sigma), (False, 260, 0.1))
        known = cohort.Camera(320, 240, [260, 260, 159.5, 119.5])
        for one in (CAMERA, known):
            with self.assertRaisesRegex(cohort.UsageError, "give one of them"):
                cohort.track(self.frames[:3], tracker="klt", camera=one, camera_prior="260")
        guess = cohort.Camera(320, 240, [260, 260, 159.5, 119.5], known=False, guess_log_sigma=0.2)
        self.assertEqual(guess.guess_log_sigma, 0.2)
        with self.assertRaisesRegex(cohort.UsageError, "uncertainty of 0"):
            cohort.Camera(320, 240, [260, 260, 159.5, 119.5], guess_log_sigma=0)

    def test_a_camera_to_doubt_is_said(self):
        with self.assertLogs("cohort", "WARNING") as log:
            cohort.track(self.frames[:3], tracker="klt", camera=cohort.Camera(320, 240, [100, 900, 159, 119]))
        self.assertIn("focal lengths 100 and 900 px", log.output[0])

    def test_frames_that_no_memory_holds_are_refused(self):
        huge = np.broadcast_to(np.uint8(0), (1 << 20, 1 << 20))
        with self.assertRaisesRegex(cohort.Error, "frame 0 .* 2.30 pixels"):
            cohort.track([huge])
        with self.assertRaisesRegex(cohort.Error, "the mask .* 2.30 pixels"):
            cohort.track(self.frames, mask=huge)

    def test_a_clip_that_breaks_off_is_said(self):
        with tempfile.TemporaryDirectory() as folder:
            clip = pathlib.Path(folder) / "rgb"
            shutil.copytree(self.dir / "clip/rgb", clip)
            (clip / "000005.png").write_bytes(b"no picture")
            with self.assertLogs("cohort", "WARNING") as log:
                tracks = cohort.track(clip, tracker="klt")
        self.assertIn("000005.png", log.output[0])
        self.assertIn("000005.png", tracks.meta["warning"])

    def test_names_that_are_no_utf_8_come_as_the_system_has_them(self):
        with tempfile.TemporaryDirectory() as folder:
            clip = os.fsencode(folder) + b"/clip\xff"
            shutil.copytree(os.fsencode(self.dir / "clip/rgb"), clip)
            os.rename(clip + b"/000000.png", clip + b"/000000\xe9.png")
            tracks = cohort.track(os.fsdecode(clip), tracker="klt")
            self.assertEqual(os.fsencode(tracks.source), clip)
            self.assertIn("000000\udce9.png", tracks.frame_names)
            tracks.write(folder + "/a.tracks")
            self.assertEqual(cohort.Tracks.read(folder + "/a.tracks").frame_names, tracks.frame_names)
            self.assertIn("000000\udce9.png", cohort.reconstruct(tracks).frame_names)

    def test_the_program_may_end_while_threads_work(self):
        code = ("import cohort, numpy, threading, time\n"
                "frames = [numpy.full((120, 160), i, numpy.uint8) for i in range(200)]\n"
                "def work():\n"
                "    while True: cohort.track((f for f in frames), tracker='klt')\n"
                "for _ in range(2): threading.Thread(target=work, daemon=True).start()\n"
                "time.sleep(0.3)\n")
        for _ in range(3):
            end = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=60)
            self.assertEqual(end.returncode, 0, end.stderr)

    def test_errors_name_files_whose_names_are_no_text(self):
        with self.assertRaisesRegex(cohort.Error, "x\udcff"):
            cohort.Tracks.read("x\udcff")
        for options in ({"features": 10**400}, {"detector": float("nan")}, {"mask": "x\udcff"}):
            with self.assertRaises(cohort.UsageError, msg=str(options)):
                cohort.track(self.frames, **options)
        with self.assertRaisesRegex(TypeError, "give cohort.Tracks"):
            cohort.reconstruct("program.tracks")

    def test_options_are_the_programs(self):
        dumped = json.loads(run("track", "--dump-config").stdout)
        options = cohort.default_options("track")
        self.assertEqual(set(dumped) - set(options), {"input", "out", "json"})
        self.assertEqual({name: dumped[name] for name in options}, options)
        dumped = json.loads(run("reconstruct", "--dump-config").stdout)
        for name, value in cohort.default_options("reconstruct").items():
            self.assertEqual(dumped[name], value)
        dumped = json.loads(run("refine", "--dump-config").stdout)
        for name, value in cohort.default_options("refine").items():
            self.assertEqual(dumped[name], value)
        # All of them are taken back.
        cohort.track(self.frames[:3], **{**options, "second_pass": ONE_PASS})


def interrupted(call):
    """What a Python says that gets Ctrl-C while it is at `call`."""
    program = f"""
import itertools, sys
import numpy as np
import cohort
frame = np.random.default_rng(0).integers(0, 255, (120, 160)).astype(np.uint8)
folder = sys.argv[1]
print("begin", flush=True)
{call}
"""
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [sys.executable, "-c", program, folder],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        process.stdout.readline()
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        # A frame takes milliseconds; a busy machine takes its time to end a Python.
        _, err = process.communicate(timeout=5)
        return err


class Example(Clip):
    def test_it_runs_on_a_clip(self):
        out = self.dir / "example"
        out.mkdir()
        end = subprocess.run(
            [sys.executable, EXAMPLE, self.dir / "clip", out],
            check=True,
            capture_output=True,
            text=True,
        )
        self.assertRegex(end.stdout, r"<cohort.Reconstruction 20 cameras, \d+ points, good>")
        self.assertIn("they move by [-1.  0.] px a frame", end.stdout.replace("-0. ", " 0. "))
        self.assertTrue((out / "clip.db").exists())

    def test_what_the_documents_show_runs(self):
        subprocess.run(
            ["ffmpeg", "-loglevel", "error", "-i", self.dir / "clip/rgb/%06d.png", "-qscale", "1",
             "-vcodec", "mpeg4", self.dir / "clip.mp4"],
            check=True,
        )
        for page in ("README.md", "docs/python.md"):
            text = (SOURCE / page).read_text()
            blocks = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
            self.assertTrue(blocks, page)
            subprocess.run([sys.executable, "-c", "".join(blocks)], check=True, cwd=self.dir,
                           stdout=subprocess.DEVNULL)


class Reconstruct(Clip):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        run("reconstruct", cls.dir / "program.tracks", "--out", cls.dir / "program_model")
        cls.model = cohort.reconstruct(cls.program_tracks)

    def test_cameras_and_points_are_the_programs(self):
        program = cohort.Reconstruction.read(self.dir / "program_model")
        np.testing.assert_array_equal(self.model.frames, np.arange(20))
        np.testing.assert_allclose(self.model.cam_from_world, program.cam_from_world, atol=1e-12)
        np.testing.assert_allclose(self.model.points, program.points, atol=1e-12)
        np.testing.assert_array_equal(self.model.track_ids, program.track_ids)
        self.assertEqual(self.model.frame_names, program.frame_names)
        ours, theirs = dict(self.model.summary), dict(program.summary)
        for summary in (ours, theirs):
            summary.pop("seconds")
            summary.pop("options")
        self.assertEqual(ours, theirs)
        self.assertEqual(self.model.quality, "good")
        self.assertFalse(self.model.failed)

    def test_points_project_to_their_views(self):
        model = self.model
        frame = np.searchsorted(model.frames, model.views["frame"])
        point = np.searchsorted(model.track_ids, model.views["track_id"])
        pose = model.cam_from_world[frame]
        in_cam = np.einsum("nij,nj->ni", pose[:, :, :3], model.points[point]) + pose[:, :, 3]
        xy = model.camera.project(in_cam)
        error = np.hypot(xy[:, 0] - model.views["x"], xy[:, 1] - model.views["y"])
        self.assertLess(error.mean(), 0.5)
        self.assertAlmostEqual(error.mean(), model.summary["mean_reprojection_px"], places=6)
        rays = np.hstack([model.camera.unproject(xy), np.ones((len(xy), 1))])
        np.testing.assert_allclose(rays, in_cam / in_cam[:, 2:], atol=1e-9)

    def test_the_cameras_are_where_the_truth_has_them(self):
        truth = np.loadtxt(self.dir / "clip/groundtruth.txt")[:, 1:4]
        ours = self.model.centers
        a, b = ours - ours.mean(0), truth - truth.mean(0)
        u, s, vt = np.linalg.svd(b.T @ a)
        flip = np.diag([1, 1, np.sign(np.linalg.det(u @ vt))])
        aligned = (s @ np.diag(flip)) / (a**2).sum() * (a @ (u @ flip @ vt).T)
        extent = np.linalg.norm(b, axis=1).max()
        self.assertLess(np.linalg.norm(aligned - b, axis=1).max(), 0.05 * extent)

    def test_a_folder_gets_all_that_the_program_writes(self):
        cohort.reconstruct(self.program_tracks, self.dir / "ours")
        names = sorted(path.name for path in (self.dir / "ours").iterdir())
        self.assertEqual(names, sorted(p.name for p in (self.dir / "program_model").iterdir()))
        for name in ("cameras.bin", "images.bin", "points3D.bin", "trajectory.tum"):
            self.assertEqual(
                (self.dir / "ours" / name).read_bytes(),
                (self.dir / "program_model" / name).read_bytes(),
                name,
            )

    def test_a_model_is_written_and_read(self):
        self.model.write(self.dir / "written")
        read = cohort.Reconstruction.read(self.dir / "written")
        np.testing.assert_allclose(read.points, self.model.points, atol=1e-12)
        np.testing.assert_allclose(read.views["x"], self.model.views["x"], atol=1e-9)
        self.assertEqual(read.summary, self.model.summary)
        self.assertFalse(read.failed)
        # Its shutter is in its summary alone.
        rolling = cohort.reconstruct(self.program_tracks, ceres={"readout": 0.4})
        rolling.write(self.dir / "written")
        read = cohort.Reconstruction.read(self.dir / "written")
        self.assertEqual((rolling.readout, read.readout), (0.4, 0.4))

    def test_reasons_have_a_code_a_sentence_and_figures(self):
        self.assertEqual(self.model.reasons, [])
        self.model.write(self.dir / "doubtful")
        summary = self.dir / "doubtful/summary.json"

        def read(*reasons):
            figures = json.loads(summary.read_text())
            summary.write_text(json.dumps({**figures, "reasons": list(reasons)}))
            return cohort.Reconstruction.read(self.dir / "doubtful").reasons

        weak = {"code": "weak-depth", "sentence": "depths: move", "figures": {"depth_uncertainty": 0.5}}
        doubt, = read(weak)
        self.assertEqual((doubt.code, doubt.sentence), ("weak-depth", "depths: move"))
        self.assertEqual(doubt.figures, {"depth_uncertainty": 0.5})
        self.assertEqual(str(doubt), "depths: move")
        for wrong in (5, "a sentence", {"code": "parts"}, {**weak, "figures": [1]}):
            with self.assertRaisesRegex(cohort.Error, "summary.json"):
                read(wrong)

    def test_every_frame_has_its_own_focal_length_in_a_zoom(self):
        camera = self.model.camera
        same = [[camera.fx, camera.fy, camera.cx, camera.cy]] * len(self.model.frames)
        np.testing.assert_array_equal(self.model.intrinsics, same)
        # The model with a camera for every image, of which each is a pixel longer than the last.
        folder = self.dir / "zoom"
        shutil.copytree(self.dir / "program_model", folder)
        for name in ("cameras", "images", "points3D"):
            (folder / f"{name}.bin").unlink()
        _, model, *numbers = (folder / "cameras.txt").read_text().splitlines()[-1].split()
        self.assertEqual(model, "PINHOLE")
        width, height, fx, fy, cx, cy = map(float, numbers)
        lines = (folder / "images.txt").read_text().splitlines()
        cameras = []
        for i, line in enumerate(lines):
            words = line.split()
            if line.startswith("#") or len(words) != 10:
                continue
            zoom = 1.0 + (int(words[0]) - 1) / fx
            numbers = (zoom * fx, zoom * fy, cx, cy)
            cameras.append(f"{words[0]} PINHOLE {width:.0f} {height:.0f} {' '.join(map(repr, numbers))}")
            lines[i] = " ".join(words[:8] + [words[0]] + words[9:])
        (folder / "cameras.txt").write_text("\n".join(cameras) + "\n")
        (folder / "images.txt").write_text("\n".join(lines) + "\n")
        zoomed = cohort.Reconstruction.read(folder)
        np.testing.assert_allclose(zoomed.intrinsics[:, 0], fx + np.arange(len(zoomed.frames)))
        np.testing.assert_allclose(zoomed.intrinsics[:, 1] / zoomed.intrinsics[:, 0], fy / fx)
        zoomed.write(self.dir / "zoom_written")
        again = cohort.Reconstruction.read(self.dir / "zoom_written")
        np.testing.assert_allclose(again.intrinsics, zoomed.intrinsics)

    def test_a_clip_without_a_model_is_no_exception(self):
        still = cohort.track([self.frames[0]] * 4, detector=FEW, second_pass=ONE_PASS)
        model = cohort.reconstruct(still)
        self.assertTrue(model.failed)
        self.assertEqual(model.quality, "failed")
        self.assertRegex(model.summary["termination"], "parallax|start|tracks")
        self.assertEqual(model.cam_from_world.shape, (0, 3, 4))

    def test_refine_measures_again_where_the_model_says(self):
        first = cohort.track(self.frames, camera=CAMERA, detector=FEW, second_pass=ONE_PASS)
        model = cohort.reconstruct(first)
        by_arrays = cohort.refine(first, model, self.frames)
        by_path = cohort.refine(first, model, self.dir / "clip")
        self.expect_same(by_arrays, by_path)
        self.expect_others(by_arrays, first)
        with self.assertRaisesRegex(cohort.UsageError, "came as arrays"):
            cohort.refine(first, model)
        with self.assertRaisesRegex(cohort.Error, "has no frame 10"):
            cohort.refine(first, model, self.frames[:10])

    def test_refine_says_what_there_is_to_doubt(self):
        with self.assertNoLogs("cohort", "WARNING"):
            cohort.refine(self.program_tracks, self.model)
        with tempfile.TemporaryDirectory() as folder:
            clip = pathlib.Path(folder) / "rgb"
            shutil.copytree(self.dir / "clip/rgb", clip)
            tracks = cohort.track(clip, camera=CAMERA, tracker="klt", detector={"max_features": 80})
            model = cohort.reconstruct(tracks)
            (clip / "000005.png").write_bytes((clip / "000006.png").read_bytes())
            with self.assertLogs("cohort", "WARNING") as log:
                cohort.refine(tracks, model)
            self.assertIn("has changed since this Tracks object was made", log.output[0])
            with self.assertLogs("cohort", "WARNING") as log:
                cohort.refine(self.program_tracks, model)
            self.assertIn("made from other tracks than this Tracks object", log.output[0])
            mask = pathlib.Path(folder) / "mask.pgm"
            mask.write_bytes(b"P5 320 240 255\n" + bytes([255]) * 76800)
            tracks = cohort.track(self.dir / "clip", camera=CAMERA, tracker="klt", mask=mask)
            mask.write_bytes(b"P5 320 240 255\n" + bytes([255]) * 76000 + bytes(800))
            with self.assertLogs("cohort", "WARNING") as log:
                cohort.refine(tracks, cohort.reconstruct(tracks))
            self.assertIn("mask.pgm has changed since", log.output[0])
        narrow = cohort.track([frame[:200] for frame in self.frames], tracker="klt")
        with self.assertRaisesRegex(cohort.Error, "its pictures are 320x240, .* 320x200"):
            cohort.refine(narrow, self.model, self.frames)

    def test_refine_finds_the_clip_that_the_tracks_are_of(self):
        refined = cohort.refine(self.program_tracks, self.model, min_confirmed=0.4)
        self.assertEqual(refined.source, str(self.dir / "clip"))

    def test_control_c_ends_it(self):
        path = str(self.dir / "program.tracks")
        call = f"""
tracks = cohort.Tracks.read({path!r})
while True: cohort.reconstruct(tracks)
"""
        self.assertIn("KeyboardInterrupt", interrupted(call))
        call = f"""
tracks = cohort.Tracks.read({path!r})
model = cohort.Reconstruction.read({str(self.dir / "program_model")!r})
while True: cohort.refine(tracks, model)
"""
        self.assertIn("KeyboardInterrupt", interrupted(call))

    def test_signals_are_seen_within_the_time_of_a_frame(self):
        """By a timer's handler, which Python calls only where cohort lets it."""
        path = str(self.dir / "program.tracks")
        for call in (
            f"cohort.track({str(self.dir / 'clip')!r})",
            f"cohort.reconstruct(tracks, ceres={{'covariances': True}})",
            f"cohort.refine(tracks, cohort.Reconstruction.read({str(self.dir / 'program_model')!r}))",
        ):
            with self.subTest(call):
                program = f"""
import signal, time
import cohort
tracks = cohort.Tracks.read({path!r})
seen = []
signal.signal(signal.SIGALRM, lambda *_: seen.append(time.perf_counter()))
signal.setitimer(signal.ITIMER_REAL, 0.01, 0.01)
seen.append(time.perf_counter())
{call}
seen.append(time.perf_counter())
signal.setitimer(signal.ITIMER_REAL, 0)
print(max(b - a for a, b in zip(seen, seen[1:])), seen[-1] - seen[0], len(seen) - 2)
"""
                end = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
                self.assertEqual(end.returncode, 0, end.stderr)
                longest, whole, signals = map(float, end.stdout.split())
                # One is seen at the end in any case.
                self.assertGreaterEqual(signals, 4, end.stdout)
                self.assertLess(longest, max(0.5, whole / 4), end.stdout)

    def test_control_c_ends_a_colmap_that_runs(self):
        colmap = self.dir / "slow_colmap"
        colmap.write_text("#!/bin/sh\nexec sleep 1000\n")
        colmap.chmod(0o755)
        options = f"backend='colmap', colmap={{'program': {str(colmap)!r}}}"
        path = str(self.dir / "program.tracks")
        err = interrupted(f"cohort.reconstruct(cohort.Tracks.read({path!r}), {options})")
        self.assertIn("KeyboardInterrupt", err)

    def test_errors_say_what_and_where(self):
        with self.assertRaisesRegex(cohort.Error, "no_such_model"):
            cohort.Reconstruction.read("no_such_model")
        with self.assertRaisesRegex(cohort.Error, "colmap is not installed"):
            cohort.reconstruct(
                self.program_tracks, backend="colmap", colmap={"program": "/no/colmap"}
            )
        with self.assertRaisesRegex(cohort.UsageError, "key ceres.readout must be a number"):
            cohort.reconstruct(self.program_tracks, ceres={"readout": "fast"})


class Files(Clip):
    def test_tracks_are_written_and_read(self):
        tracks = self.program_tracks
        tracks.write(self.dir / "again.tracks")
        again = cohort.Tracks.read(self.dir / "again.tracks")
        self.expect_same(again, tracks)
        self.assertEqual(again.meta, tracks.meta)
        self.assertEqual(again.ends, tracks.ends)
        self.assertEqual(again.camera.text, CAMERA)

    def test_arrays_make_the_same_tracks(self):
        tracks = self.program_tracks
        size = dict(width_px=320, height_px=240, camera=tracks.camera)
        by_rows = cohort.Tracks.from_observations(tracks.observations, **size)
        self.expect_same(by_rows, tracks)
        dense = tracks.dense()
        self.assertEqual(dense.xy.shape, (20, len(tracks.track_ids), 2))
        by_dense = cohort.Tracks.from_dense(dense.xy, dense.observed, dense.covariances, **size)
        for name in ("frame", "x", "y", "observed", "cov_xx", "cov_xy", "cov_yy"):
            np.testing.assert_array_equal(by_dense.observations[name], tracks.observations[name])
        np.testing.assert_array_equal(
            dense.track_ids[by_dense.observations["track_id"]], tracks.observations["track_id"]
        )
        named = cohort.Tracks.from_dense(dense.xy, dense.observed, dense.covariances, **size,
                                         frames=dense.frames, track_ids=dense.track_ids)
        np.testing.assert_array_equal(
            named.observations["track_id"], tracks.observations["track_id"]
        )
        model = cohort.reconstruct(by_rows)
        np.testing.assert_array_equal(
            model.points, cohort.reconstruct(tracks).points
        )

    def test_frames_that_are_not_all_of_the_clip_go_both_ways(self):
        size = dict(width_px=320, height_px=240)
        tracks = cohort.track(self.dir / "clip", tracker="klt", detector=FEW, frames="4:16:2")
        dense = tracks.dense()
        again = cohort.Tracks.from_dense(dense.xy, dense.observed, frames=dense.frames, **size)
        np.testing.assert_array_equal(again.frames, [4, 6, 8, 10, 12, 14])
        np.testing.assert_array_equal(again.observations["frame"], tracks.observations["frame"])
        rows = cohort.Tracks.from_observations(tracks.observations, frames=[4, 6, 8, 10, 12, 14, 16], **size)
        self.assertEqual(rows.frame_names[-1], "frame_000016.png")
        for frames, what in (
            ([4, 6], "there are 2 frames"),
            ([4, 6, 8, 10, 14, 12], "frame 12 comes after frame 14"),
            ([4, 6, 8, 10, 12, -1], "not 32-bit ids"),
            ([4, 6, 8, 10, 12, 0.5], "give integers"),
            ([4, 6, 8, 10, 12, 10**7], "up to 10000000"),
        ):
            with self.subTest(frames), self.assertRaisesRegex(cohort.UsageError, what):
                cohort.Tracks.from_dense(dense.xy, frames=frames, **size)
        with self.assertRaisesRegex(cohort.Error, "in frame 6, which is not one of the 5"):
            cohort.Tracks.from_observations(tracks.observations, frames=[4, 8, 10, 12, 14], **size)

    def test_what_lies_outside_the_pictures_is_predicted(self):
        xy = np.full((3, 2, 2), 5.0)
        xy[1, 0] = [320, 5]
        with self.assertLogs("cohort", "WARNING") as log:
            tracks = cohort.Tracks.from_dense(xy, width_px=320, height_px=240)
        self.assertIn("1 observed positions lie outside", log.output[0])
        self.assertEqual(tracks.observations["observed"].sum(), 5)
        with self.assertRaisesRegex(cohort.Error, "6 of 6 observed positions lie outside"):
            cohort.Tracks.from_dense(xy + 400, width_px=320, height_px=240)

    def test_a_dense_array_says_where_each_track_is(self):
        tracks = self.program_tracks
        dense = tracks.dense()
        for row in tracks.observations[:: len(tracks.observations) // 50]:
            t = list(dense.frames).index(row["frame"])
            n = list(dense.track_ids).index(row["track_id"])
            self.assertEqual(tuple(dense.xy[t, n]), (row["x"], row["y"]))
            self.assertEqual(dense.observed[t, n], row["observed"])
        self.assertEqual(np.isfinite(dense.xy).all(2).sum(), len(tracks.observations))

    def test_csv_goes_both_ways(self):
        self.program_tracks.write_csv(self.dir / "tracks.csv")
        run("export", self.dir / "program.tracks", "--csv", self.dir / "program.csv")
        self.assertEqual(
            (self.dir / "tracks.csv").read_bytes(), (self.dir / "program.csv").read_bytes()
        )
        read = cohort.Tracks.read_csv(self.dir / "tracks.csv", width_px=320, height_px=240)
        for name in ("frame", "track_id", "x", "y", "observed", "residual"):
            np.testing.assert_array_equal(
                read.observations[name], self.program_tracks.observations[name]
            )
        self.assertIsNone(read.camera)

    def test_what_a_csv_has_outside_of_the_pictures_is_predicted(self):
        path = self.dir / "outside.csv"
        path.write_text("track_id,frame,x,y\n" + "".join(f"1,{t},5,5\n" for t in range(3))
                        + f"{2 ** 40},0,-500,5\n")
        with self.assertLogs("cohort", "WARNING") as log:
            read = cohort.Tracks.read_csv(path, width_px=320, height_px=240)
        self.assertIn("renumbered", log.output[0])
        self.assertIn("1 observed positions lie outside", log.output[1])
        self.assertEqual(read.observations["observed"].sum(), 3)

    def test_masked_covariances_are_none(self):
        covariances = np.ma.masked_array(np.full((2, 1, 2, 2), 777.0), True)
        covariances[0] = np.eye(2)
        tracks = cohort.Tracks.from_dense(
            np.full((2, 1, 2), 5.0), covariances=covariances, width_px=320, height_px=240
        )
        np.testing.assert_array_equal(tracks.observations["cov_xx"], [1, np.nan])

    def test_a_colmap_database_is_the_programs(self):
        self.program_tracks.write_colmap_database(self.dir / "ours.db", max_relative_sigma=2.0)
        run("export", self.dir / "program.tracks", "--colmap-database", self.dir / "program.db",
            "--database.max-relative-sigma", 2)
        dumps = []
        for name in ("ours.db", "program.db"):
            with sqlite3.connect(self.dir / name) as database:
                dumps.append(list(database.iterdump()))
        self.assertEqual(*dumps)
        self.assertGreater(len(dumps[0]), 60)

        read = cohort.Tracks.read_colmap_database(self.dir / "ours.db")
        self.assertEqual(read.frame_names, self.program_tracks.frame_names)
        self.assertEqual(read.camera.text, CAMERA)
        self.assertEqual((read.width_px, read.height_px), (320, 240))
        positions = [  # COLMAP's, which are floats
            {(r["frame"], *np.float32([r["x"] + 0.5, r["y"] + 0.5])) for r in rows}
            for rows in (read.observations, self.program_tracks.observations)
        ]
        self.assertGreater(len(positions[0]), 0.8 * len(positions[1]))
        self.assertFalse(positions[0] - positions[1])
        self.assertFalse(cohort.reconstruct(read).failed)
        with self.assertRaisesRegex(cohort.Error, "no_such.db"):
            cohort.Tracks.read_colmap_database("no_such.db")
        with sqlite3.connect(self.dir / "ours.db") as database:  # as COLMAP's threads leave it
            database.execute("UPDATE images SET name = 'rgb/x' || name WHERE image_id = 1")
        with self.assertLogs("cohort", "WARNING") as log:
            cohort.Tracks.read_colmap_database(self.dir / "ours.db")
        self.assertIn("not numbered in the order of their names", log.output[0])

    def test_tables_that_are_no_tracks_are_refused(self):
        xy = np.zeros((3, 2, 2))
        size = {"width_px": 9, "height_px": 9}
        with self.assertRaisesRegex(cohort.UsageError, "give True or False"):
            cohort.Tracks.from_dense(xy, np.full((3, 2), 0.5), **size)
        with self.assertRaisesRegex(cohort.UsageError, "-1 x 9 px"):
            cohort.Tracks.from_dense(xy, width_px=-1, height_px=9)
        row = {"frame": [4_000_000_000], "track_id": [0], "x": [1], "y": [1]}
        with self.assertRaisesRegex(cohort.UsageError, "4000000001 frames"):
            cohort.Tracks.from_observations(row, **size)
        masked = np.ma.masked_equal([1.0], 1.0)
        with self.assertRaisesRegex(cohort.UsageError, "x has masked values"):
            cohort.Tracks.from_observations({**row, "frame": [0], "x": masked}, **size)
        there = cohort.Tracks.from_dense(np.ma.masked_equal(xy - [[[0], [7]]], -7), **size)
        self.assertEqual(len(there.observations), 3)

    def test_bad_tracks_are_refused(self):
        size = dict(width_px=320, height_px=240)
        good = {"frame": [0, 1], "track_id": [0, 0], "x": [1.0, 2.0], "y": [3.0, 4.0]}
        self.assertEqual(len(cohort.Tracks.from_observations(good, **size).track_ids), 1)
        for column, values, what in (
            ("frame", [0, -1], "not 32-bit ids"),
            ("track_id", [0.5, 1.0], "give integers"),
            ("x", [1.0, np.nan], "finite"),
            ("frame", [1, 1], "twice|duplicate|two"),
            ("y", [1.0], "has the shape"),
            ("residual", [0.0, np.inf], "residual is not finite"),
            ("colour", [0, 0], "colour, which is unknown"),
        ):
            with self.subTest(column), self.assertRaisesRegex(cohort.Error, what):
                cohort.Tracks.from_observations({**good, column: values}, **size)
        covariance = {"cov_xx": [1.0, 1.0], "cov_xy": [0.0, 2.0], "cov_yy": [1.0, 1.0]}
        with self.assertRaisesRegex(cohort.Error, "observation 1: .* not positive definite"):
            cohort.Tracks.from_observations({**good, **covariance}, **size)
        with self.assertRaisesRegex(cohort.UsageError, "no column y"):
            cohort.Tracks.from_observations({"frame": [], "track_id": [], "x": []}, **size)
        with self.assertRaisesRegex(cohort.Error, "frame 1, which is not one of the 1 frames"):
            cohort.Tracks.from_observations(good, frames=1, **size)
        with self.assertRaisesRegex(cohort.UsageError, r"give \(frames, tracks, 2\)"):
            cohort.Tracks.from_dense(np.zeros((3, 4)), **size)
        with self.assertRaisesRegex(cohort.Error, "no_such.tracks"):
            cohort.Tracks.read("no_such.tracks")
        with self.assertRaisesRegex(cohort.UsageError, "at least fx, fy, cx, cy: 2"):
            cohort.Camera(320, 240, [1, 2])


if __name__ == "__main__":
    unittest.main()
