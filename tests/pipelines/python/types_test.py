"""What the package says of its types is so, and its users' programs are checked against it."""

import ast
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import cohort
from cohort import _cohort

SOURCE = pathlib.Path(os.environ["COHORT_SOURCE_DIR"])
PACKAGE = pathlib.Path(cohort.__file__).parent


def check(folder, *command):
    """Types are checked by Debian's mypy, which is Python's own for this Python."""
    environment = {**os.environ, "MYPYPATH": str(PACKAGE.parent), "PYTHONPATH": str(PACKAGE.parent)}
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment)


class Types(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def expect_clean(self, *command):
        end = check(self.folder, *command)
        self.assertEqual(end.returncode, 0, end.stdout + end.stderr)

    def test_the_package_keeps_its_own_types(self):
        self.expect_clean("/usr/bin/mypy", "--strict", "-p", "cohort")

    def test_the_stub_is_of_the_module(self):
        # pybind11's metaclass, and that nobody makes a Model or a TrackFile, are not Python's to say.
        allowed = self.folder / "allowed"
        allowed.write_text("cohort._cohort.(Camera|(Model|TrackFile)(.__init__)?)\n")
        self.expect_clean("/usr/bin/stubtest", "cohort._cohort", "--allowlist", str(allowed))
        stub = ast.parse((PACKAGE / "_cohort.pyi").read_text())
        named = {getattr(node, "name", None) or node.target.id for node in stub.body
                 if isinstance(node, (ast.ClassDef, ast.FunctionDef, ast.AnnAssign))}
        hidden = {name for name in named if name.startswith("_") and name != "__version__"}
        module = {name for name in vars(_cohort) if not name.startswith("_")} | {"__version__"}
        self.assertEqual(named - hidden, module)

    def test_functions_take_what_the_stub_says(self):
        """pybind11 says its parameters in the docstring alone, where stubtest does not look."""
        stub = ast.parse((PACKAGE / "_cohort.pyi").read_text())
        checked = 0
        for holder, body in [(_cohort, stub.body)] + [
            (getattr(_cohort, node.name), node.body)
            for node in stub.body
            if isinstance(node, ast.ClassDef)
        ]:
            for node in body:
                if not isinstance(node, ast.FunctionDef) or node.decorator_list:
                    continue
                signature = getattr(holder, node.name).__doc__.split(" -> ")[0]
                names = re.findall(r"[(,] ?(\w+)(?=:)", re.sub(r"\[.*?\]+", "", signature))
                stubbed = [argument.arg for argument in node.args.args]
                self.assertEqual(names, stubbed, signature)
                checked += 1
        self.assertGreater(checked, 15)

    def test_programs_are_checked(self):
        example = SOURCE / "pipelines/python/examples/clip_to_cameras.py"
        self.expect_clean("/usr/bin/mypy", "--check-untyped-defs", str(example))
        wrong = self.folder / "wrong.py"
        wrong.write_text("import cohort\ncohort.track(7)\ncohort.track('a').fps\n")
        end = check(self.folder, "/usr/bin/mypy", str(wrong))
        self.assertEqual(end.returncode, 1)
        self.assertIn('"track" has incompatible type "int"', end.stdout)
        self.assertIn('"Tracks" has no attribute "fps"', end.stdout)


if __name__ == "__main__":
    sys.exit(unittest.main())
