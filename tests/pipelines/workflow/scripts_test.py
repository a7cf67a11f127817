"""pipelines/workflow with a program that only says how it was called: what Snakemake's kills and changed clips do."""

import csv
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

WORKFLOW = pathlib.Path(os.environ["COHORT_SOURCE_DIR"]) / "pipelines/workflow"

COHORT = """#!/bin/sh
echo "begins $*" >> calls
while [ -e wait ]; do sleep 0.02; done
[ "$1" != compare ] || touch out/grid/results.csv out/grid/results.json out/grid/report.html
echo ends >> calls
[ ! -e error ] || { cat error; exit 1; }
case "$*" in *--resume) [ ! -e stale ] || { cat stale; exit 1; };; esac
"""


class InAFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.dir = pathlib.Path(folder.name)
        (self.dir / "cohort").write_text(COHORT)
        (self.dir / "cohort").chmod(0o755)

    def calls(self):
        return (self.dir / "calls").read_text().splitlines() if (self.dir / "calls").exists() else []


class RunScene(InAFolder):
    def start(self):
        command = [sys.executable, WORKFLOW / "run_scene.py", "a.json", "a.log", "./cohort", "sfm", "a"]
        with (self.dir / "errors").open("w") as errors:
            return subprocess.Popen(command, cwd=self.dir, stderr=errors)

    def errors(self):
        return (self.dir / "errors").read_text()

    def wait_for(self, happens):
        until = time.monotonic() + 60
        while not happens():
            self.assertLess(time.monotonic(), until)
            time.sleep(0.02)

    def record(self):
        return json.loads((self.dir / "a.json").read_text())

    def end(self, job, code=0):
        self.assertEqual(job.wait(timeout=60), code, self.errors())

    def test_what_lives_on_is_waited_for(self):
        for killed in (False, True):
            with self.subTest(killed=killed):
                (self.dir / "calls").unlink(missing_ok=True)
                (self.dir / "wait").touch()
                old = self.start()
                self.wait_for(self.calls)
                if killed:
                    old.kill()
                    old.wait()
                new = self.start()
                self.wait_for(lambda: "waits" in self.errors())
                self.assertEqual(self.calls(), ["begins sfm a"])
                (self.dir / "wait").unlink()
                if not killed:
                    self.end(old)
                self.end(new)
                self.assertEqual(self.calls(), ["begins sfm a", "ends", "begins sfm a --resume", "ends"])
                self.assertEqual((self.record()["exit_code"], self.record()["error"]), (0, None))
                self.assertFalse((self.dir / "a.json.begun").exists())

    def test_what_cannot_be_resumed_is_made_anew(self):
        (self.dir / "wait").touch()
        old = self.start()
        self.wait_for(self.calls)
        old.kill()
        old.wait()
        (self.dir / "stale").write_text(
            "cohort: error: cannot resume a/clip.tracks: it was made from another input or with other options; "
            "without --resume it is created again\n"
        )
        (self.dir / "wait").unlink()
        self.end(self.start())
        self.assertEqual(
            self.calls(), ["begins sfm a", "ends", "begins sfm a --resume", "ends", "begins sfm a", "ends"]
        )
        self.assertEqual((self.record()["exit_code"], self.record()["error"]), (0, None))

    def test_somebody_elses_run_is_no_failure_of_the_clip(self):
        (self.dir / "error").write_text("cohort: error: cannot write a: another run is writing it; wait\n")
        self.end(self.start(), 1)
        self.assertIn("another run is writing it", self.errors())
        self.assertFalse((self.dir / "a.json").exists())
        (self.dir / "error").write_text("cohort: error: no frames\n")
        self.end(self.start())
        self.assertEqual((self.record()["exit_code"], self.record()["error"]), (1, "no frames"))
        self.assertEqual(self.calls()[2], "begins sfm a --resume")

    def test_a_failed_scene_has_no_figures_of_an_earlier_one(self):
        def row():
            command = [sys.executable, WORKFLOW / "scenes_table.py", ".", "scenes.csv", "a"]
            subprocess.run(command, cwd=self.dir, check=True, capture_output=True)
            with (self.dir / "scenes.csv").open() as table:
                return next(csv.DictReader(table))

        summary = self.dir / "a/summary.json"
        summary.parent.mkdir()
        figures = {"quality": "doubtful", "registered": 12, "frames": 12, "points": 500}
        reason = {"code": "weak-depth", "sentence": "depths", "figures": {"depth_uncertainty": 0.4}}
        figures |= {"reasons": [reason], "film_better": ["slower"]}
        summary.write_text(json.dumps(figures))
        self.end(self.start())
        self.assertEqual((row()["quality"], row()["registered"]), ("doubtful", "12"))
        self.assertEqual(row()["note"], "depths; slower")
        (self.dir / "error").write_text("cohort: error: no frames\n")
        self.end(self.start())
        self.assertEqual(row()["quality"], "failed")
        self.assertEqual((row()["registered"], row()["points"], row()["note"]), ("", "", "no frames"))
        # One that was made, and has too few frames with a pose.
        (self.dir / "cohort").write_text(COHORT + "touch a/summary.json; exit 1\n")
        (self.dir / "error").unlink()
        self.end(self.start())
        self.assertEqual((row()["quality"], row()["registered"]), ("failed", "12"))


@unittest.skipUnless(shutil.which("snakemake"), "no snakemake: apt-get install snakemake")
class ChangedClips(InAFolder):
    CONFIG = """
cohort: ./cohort
out: out
scenes: {clips: [clip]}
grid: {clips: ["more/*.png"], shards: 1}
"""

    def run_workflow(self):
        """Which commands were called."""
        (self.dir / "calls").unlink(missing_ok=True)
        command = ["snakemake", "--snakefile", WORKFLOW / "Snakefile", "--configfile", "config.yaml"]
        end = subprocess.run(command + ["--cores", "1"], cwd=self.dir, capture_output=True, text=True)
        self.assertEqual(end.returncode, 0, end.stderr)
        return sorted({line.split()[1] for line in self.calls() if line.startswith("begins")})

    def test_pictures_of_folders_and_globs_are_watched(self):
        (self.dir / "config.yaml").write_text(self.CONFIG)
        pictures = [self.dir / "clip/rgb/0.png", self.dir / "more/0.png"]
        for picture in pictures:
            picture.parent.mkdir(parents=True)
            picture.write_text("0")
        self.assertEqual(self.run_workflow(), ["compare", "sfm"])
        self.assertEqual(self.run_workflow(), [])
        pictures[0].write_text("another")
        self.assertEqual(self.run_workflow(), ["sfm"])
        # Of a folder that is a link, and of one that leads back.
        (self.dir / "elsewhere").mkdir()
        (self.dir / "elsewhere/0.png").write_text("0")
        (self.dir / "clip/depth").symlink_to(self.dir / "elsewhere")
        (self.dir / "clip/rgb/clip").symlink_to(self.dir / "clip")
        self.assertEqual(self.run_workflow(), ["sfm"])
        (self.dir / "elsewhere/0.png").write_text("another")
        self.assertEqual(self.run_workflow(), ["sfm"])
        pictures[1].write_text("another")
        self.assertEqual(self.run_workflow(), ["compare"])
        pictures[1].with_name("1.png").write_text("0")
        self.assertEqual(self.run_workflow(), ["compare"])
        self.assertEqual(self.run_workflow(), [])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
