"""All scenes in one table: a row a clip, whether there is a scene of it or not.

usage: scenes_table.py FOLDER TABLE.csv NAME...

Reads FOLDER/NAME.json (run_scene.py's record) and FOLDER/NAME/summary.json (cohort's), writes the
table and prints it. A clip without a record has not finished: its row says so.
"""

import csv
import json
import os
import sys

COLUMNS = [
    "scene",
    "quality",
    "registered",
    "frames",
    "images",
    "points",
    "expected_error_percent",
    "seconds",
    "exit_code",
    "note",
]


def read(path):
    try:
        with open(path, encoding="utf-8") as text:
            return json.load(text)
    except FileNotFoundError:
        return {}


def row(folder, name):
    record = read(os.path.join(folder, name + ".json"))
    if not record:
        return {"scene": name, "quality": "failed", "note": "not finished: run the workflow again"}
    summary = os.path.join(folder, name, "summary.json")
    figures = read(summary)
    failed = record["exit_code"] != 0
    # A run that fails early leaves the earlier scene as it was.
    if failed and figures and os.path.getmtime(summary) < record.get("began", 0):
        figures = {}
    error = figures.get("expected_error")
    return {
        "scene": name,
        "quality": "failed" if failed else figures.get("quality") or "not judged",
        "registered": figures.get("registered", ""),
        "frames": figures.get("frames", ""),
        "images": figures.get("images", ""),
        "points": figures.get("points", ""),
        # Of a failed model it would mean nothing.
        "expected_error_percent": "" if failed or error is None else f"{100 * error:.2g}",
        "seconds": record["seconds"],
        "exit_code": record["exit_code"],
        "note": record["error"] or "; ".join(words_of(figures)),
    }


def words_of(figures):
    return [reason["sentence"] for reason in figures.get("reasons", [])] + figures.get("film_better", [])


def print_table(rows):
    columns = [column for column in COLUMNS if column not in ("exit_code", "note")]
    lines = [columns] + [[str(row.get(column, "")) for column in columns] for row in rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(columns))]
    for line in lines:
        print("  ".join(word.ljust(width) for word, width in zip(line, widths)).rstrip())
    for row in rows:
        if row["note"]:
            print(f"{row['scene']}: {row['note']}")


def main():
    if len(sys.argv) < 4:
        sys.exit("usage: scenes_table.py FOLDER TABLE.csv NAME...")
    folder, table, names = sys.argv[1], sys.argv[2], sys.argv[3:]
    rows = [row(folder, name) for name in names]
    with open(table + ".partial", "w", encoding="utf-8", newline="") as out:
        writer = csv.DictWriter(out, COLUMNS, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    os.replace(table + ".partial", table)
    print_table(rows)


if __name__ == "__main__":
    main()
