# shellcheck shell=bash disable=SC2164
# Sourced by the other scripts: where the sources are, which compiler is used, which files are formatted.
ROOT="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
cd "$ROOT"

# Clang where there is one: with a precompiled header it compiles a file in a fifth of GCC's time.
if [[ -z "${CXX:-}" ]] && command -v clang++ >/dev/null; then
  export CC=clang CXX=clang++
fi

# How many compilers may run: one for each core, and each with 1.5 GB of memory.
compile_jobs() {
  local cores memory
  cores=$(nproc)
  memory=$(awk '/MemAvailable/ {print int($2 / 1500000)}' /proc/meminfo 2>/dev/null || echo "$cores")
  echo $((memory < 1 ? 1 : memory < cores ? memory : cores))
}

build() {  # PRESET [TARGET...]
  local preset=$1
  shift
  cmake --preset "$preset"
  cmake --build --preset "$preset" -j "$(compile_jobs)" ${@:+--target "$@"}
}

# All C++ sources that git tracks, or, outside a checkout, all there are.
sources() {
  git ls-files -- '*.h' '*.cpp' 2>/dev/null || find libeditnerf apps tests -name '*.h' -o -name '*.cpp'
}

# Versions of clang-format disagree about braces in arguments, so one of them decides.
readonly CLANG_FORMAT_VERSION=14

# The program of that version, if it is here.
clang_format() {
  local program
  for program in "clang-format-$CLANG_FORMAT_VERSION" clang-format; do
    if "$program" --version 2>/dev/null | grep -q "version $CLANG_FORMAT_VERSION\."; then
      echo "$program"
      return
    fi
  done
}

require() {  # PROGRAM...
  local program
  for program in "$@"; do
    if ! command -v "$program" >/dev/null; then
      echo "$(basename "$0"): $program is missing; run scripts/setup" >&2
      exit 1
    fi
  done
}
