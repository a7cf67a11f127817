"""Makes one scene and records how that ended.

usage: run_scene.py RECORD LOG COMMAND...

RECORD is JSON: exit_code (negative: the signal that killed it), error (its line, or null), seconds,
began (by the clock of the file system, as the times of its files are).
Ends with 0 however the command ended: a clip that fails stops no other. What kills the job as a
whole leaves no record, so the scene is made again: with --resume, from where it was, if the command
is the same; anew, if that cannot go on, as the clip has changed since. What outlives a killed job is
waited for. Where somebody else writes the scene it ends with 1 and leaves no record: nothing is known
of the clip.
"""

import contextlib
import fcntl
import json
import os
import subprocess
import sys
import time


def read(path):
    try:
        with open(path, encoding="utf-8") as text:
            return json.load(text)
    except (FileNotFoundError, json.JSONDecodeError):
        return None


def write(path, value):
    with open(new_file(path + ".partial"), "w", encoding="utf-8") as out:
        json.dump(value, out, indent=2)
        out.write("\n")
    os.replace(path + ".partial", path)


def new_file(path):
    """A descriptor of an empty file in the place of what was there, not of where a link leads."""
    with contextlib.suppress(FileNotFoundError):
        os.unlink(path)
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666)


def lock(path):
    """A descriptor: held until this process and all that inherit it have ended."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW, 0o666)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        print(f"run_scene: waits for an earlier job that has {path}", file=sys.stderr, flush=True)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
    except OSError:
        pass  # a file system without locks
    return descriptor


def error_of(log, exit_code):
    """The program's own line, or what the system says."""
    if exit_code == 0:
        return None
    with open(log, encoding="utf-8", errors="replace") as lines:
        errors = [line for line in lines if line.startswith("cohort: error: ")]
    if errors:
        return errors[-1].removeprefix("cohort: error: ").strip()
    if exit_code < 0:
        return f"killed by signal {-exit_code}"
    return f"exit code {exit_code}, see {log}"


def run(command, log, held):
    """Its exit code, and its error or None."""
    with open(new_file(log), "wb") as output:
        exit_code = subprocess.call(command, stdout=output, stderr=subprocess.STDOUT, pass_fds=[held])
    return exit_code, error_of(log, exit_code)


def main():
    if len(sys.argv) < 4:
        sys.exit("usage: run_scene.py RECORD LOG COMMAND...")
    record, log, command = sys.argv[1], sys.argv[2], sys.argv[3:]
    begun = record + ".begun"
    # Before it waits: a job that ends in the meantime has made what is resumed.
    resume = ["--resume"] if read(begun) == command else []
    # The command holds it, too: it may outlive this process.
    held = lock(record + ".lock")
    if not resume or not os.path.exists(begun):
        write(begun, command)
    began = os.path.getmtime(begun)
    start = time.monotonic()
    exit_code, error = run(command + resume, log, held)
    if error and "without --resume it is created again" in error:
        exit_code, error = run(command, log, held)
    if error and "another run is writing it" in error:
        sys.exit(f"run_scene: error: {error}")
    write(
        record,
        {
            "exit_code": exit_code,
            "error": error,
            "seconds": round(time.monotonic() - start, 1),
            "began": began,
        },
    )
    with contextlib.suppress(FileNotFoundError):
        os.remove(begun)


if __name__ == "__main__":
    main()
