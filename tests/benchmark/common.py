"""What the scripts of this folder share: running programs, clips without their calibration or filtered by ffmpeg, the
program of a changed copy of the last commit, the figures of `compare`, and the tables of pages."""
import collections
import csv
import math
import os
import pathlib
import shutil
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]


def run(*command, check=True, **options):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, **options)
    if check and done.returncode:
        raise RuntimeError(f'{" ".join(str(word) for word in command)}: {(done.stderr.strip() or done.stdout)[-2000:]}')
    return done


def without_calibration(folder, copy):
    """Makes `copy` a clip in TUM layout with the files of `folder` but its calibration."""
    if not copy.exists():
        copy.mkdir(parents=True)
        for entry in pathlib.Path(folder).iterdir():
            if entry.name != 'calibration.txt':
                (copy / entry.name).symlink_to(entry.resolve())
    return copy


def check_out(tree, commit='HEAD'):
    """Makes `tree` a copy of a commit; what was built there stays."""
    if not tree.exists():
        run('git', 'worktree', 'prune', cwd=ROOT)  # those whose folder is gone
        run('git', 'worktree', 'add', '--detach', tree, commit, cwd=ROOT)
    run('git', 'reset', '--hard', run('git', 'rev-parse', commit, cwd=ROOT).stdout.strip(), cwd=tree)


def build(tree):
    """Builds the program in `tree` and returns its path."""
    environment = {**os.environ, 'CCACHE_BASEDIR': str(tree), 'CCACHE_NOHASHDIR': '1'}
    if not (tree / 'build/build.ninja').exists():
        run('cmake', '--preset', 'ci', '-DCOHORT_BUILD_TESTS=OFF', '-DCOHORT_BUILD_PYTHON=OFF', cwd=tree,
            env=environment)
    run('cmake', '--build', 'build', '--target', 'cohort', cwd=tree, env=environment)
    return tree / 'build/cohort'


def filtered(clip, out, by, calibration=None):
    """Makes `out` the clip in TUM layout after a filter of ffmpeg, with another calibration.txt if one is given."""
    if not out.exists():
        partial = out.with_suffix('.partial')
        shutil.rmtree(partial, ignore_errors=True)
        (partial / 'rgb').mkdir(parents=True)
        run('ffmpeg', '-loglevel', 'error', '-pattern_type', 'glob', '-i', clip / 'rgb/*.png', '-vf', by, '-start_number',
            0, partial / 'rgb/%06d.png')
        for name in ('rgb.txt', 'groundtruth.txt', 'calibration.txt'):  # not its depths
            shutil.copy(clip / name, partial)
        if calibration:
            (partial / 'calibration.txt').write_text(calibration)
        partial.rename(out)
    return out


def figures_of(out):
    """{(clip, level, seed): {metric: value}} of the results in a folder of `compare` with one tracker and one backend; a
    cell that failed has none."""
    figures = collections.defaultdict(dict)
    for line in csv.DictReader(open(out / 'results.csv')):
        of_cell = figures[line['sequence'], line['level'], line['seed']]
        if line['value']:
            of_cell[line['metric']] = float(line['value'])
    return figures


def is_whole(figures):
    """Whether a model has 95 % of the frames."""
    return figures.get('registered', 0) >= .95 * figures.get('frames', math.inf)


def between(page, name, text):
    """Puts the text between the marks NAME and `end of NAME` of a page."""
    begin, end = f'<!-- {name} -->\n', f'<!-- end of {name} -->\n'
    before, rest = page.read_text().split(begin)
    page.write_text(before + begin + text + end + rest.split(end)[1])
