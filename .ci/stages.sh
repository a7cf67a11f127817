# What `run` and `nightly` share: stages with their seconds, and the builds with sanitizers.

# Where ccache is installed, what was compiled in another folder serves here, too; so does what
# clang-tidy found clean.
export CCACHE_BASEDIR=$PWD CCACHE_NOHASHDIR=1 CCACHE_SLOPPINESS=pch_defines,time_macros
caches=${XDG_CACHE_HOME:-${HOME:+$HOME/.cache}}
export COHORT_TIDY_CLEAN=${caches:-$PWD/build-tidy}/cohort-tidy

seconds=()
report() {
  printf '\n== Seconds\n'
  printf '%s\n' "${seconds[@]}"
  printf '%6d  in all\n' "$SECONDS"
}
trap report EXIT

# What would begin after LATEST_START is left out, and the table of seconds says so.
stage() { # stage LATEST_START NAME COMMAND...
  local latest_start=$1 name=$2 began=$SECONDS
  shift 2
  if ((began > latest_start)); then
    seconds+=("     -  $name: LEFT OUT, there was no time")
    return
  fi
  printf '\n== %s\n' "$name"
  "$@"
  seconds+=("$(printf '%6d  %s' $((SECONDS - began)) "$name")")
}

sanitized() { # sanitized PRESET TARGETS [TESTS]: builds them, and runs the tests of the preset that match
  cmake --preset "$1"
  # shellcheck disable=SC2086 # several targets
  cmake --build "build-$1" --target $2
  ctest --preset "$1" -R "${3:-.}" --no-tests=error -j "$(nproc)"
}
