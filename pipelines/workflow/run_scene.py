"""Makes one scene and records how that ended.

usage: run_scene.py RECORD LOG COMMAND...

RECORD is JSON: exit_code (negative: the signal that killed it), error (its line, or null), seconds.
Ends with 0 however the command ended: a clip that fails stops no other. What kills the job as a
whole leaves no record, so the scene is made again: with --resume, from where it was, if the command
is the same.
"""

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
    with open(path + ".partial", "w", encoding="utf-8") as out:
        json.dump(value, out, indent=2)
        out.write("\n")
    os.replace(path + ".partial", path)


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


def main():
    if len(sys.argv) < 4:
        sys.exit("usage: run_scene.py RECORD LOG COMMAND...")
    record, log, command = sys.argv[1], sys.argv[2], sys.argv[3:]
    begun = record + ".begun"
    if read(begun) == command:
        command = command + ["--resume"]
    else:
        write(begun, command)
    start = time.monotonic()
    with open(log, "wb") as output:
        exit_code = subprocess.call(command, stdout=output, stderr=subprocess.STDOUT)
    write(
        record,
        {
            "exit_code": exit_code,
            "error": error_of(log, exit_code),
            "seconds": round(time.monotonic() - start, 1),
        },
    )
    os.remove(begun)


if __name__ == "__main__":
    main()
