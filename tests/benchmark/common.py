"""What the scripts of this folder share: running programs, clips without their calibration, and the program of a
changed copy of the last commit."""
import os
import pathlib
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


def check_out(tree):
    """Makes `tree` a copy of the last commit; what was built there stays."""
    if not tree.exists():
        run('git', 'worktree', 'add', '--detach', tree, 'HEAD', cwd=ROOT)
    run('git', 'reset', '--hard', run('git', 'rev-parse', 'HEAD', cwd=ROOT).stdout.strip(), cwd=tree)


def build(tree):
    """Builds the program in `tree` and returns its path."""
    environment = {**os.environ, 'CCACHE_BASEDIR': str(tree), 'CCACHE_NOHASHDIR': '1'}
    if not (tree / 'build/build.ninja').exists():
        run('cmake', '--preset', 'ci', '-DCOHORT_BUILD_TESTS=OFF', '-DCOHORT_BUILD_PYTHON=OFF', cwd=tree,
            env=environment)
    run('cmake', '--build', 'build', '--target', 'cohort', cwd=tree, env=environment)
    return tree / 'build/cohort'
