// A stand-in for the COLMAP program: a shell script that notes its calls and "maps" by copying a prepared model.
#pragma once

#include <filesystem>
#include <string>

#include "tests/imaging/colmap_fixture.h"
#include "tests/imaging/scratch_folder.h"

namespace editnerf {

// The script's path. Calls are appended to FOLDER/calls.txt; its help knows the options named in `known`. The mapper
// copies every folder of FOLDER/models, or exits with 1 where there is none.
inline std::string WriteFakeColmap(const std::filesystem::path& folder, const std::string& known,
                                   const std::string& extra = "") {
  const std::filesystem::path script = folder / "colmap";
  WriteText(script, R"sh(#!/bin/sh
command=$1
here=$(dirname "$0")
case "$*" in
  *" -h") for option in )sh" +
                        known + R"sh(; do echo "  --$option arg (=1)"; done; exit 0;;
esac
echo "$QT_QPA_PLATFORM $*" >> "$here/calls.txt"
)sh" + extra + R"sh(
if [ "$command" = mapper ]; then
  while [ $# -gt 0 ]; do
    if [ "$1" = --output_path ]; then out=$2; fi
    shift
  done
  if [ ! -d "$here/models" ]; then echo "ERROR: no initial pair"; exit 1; fi
  cp -r "$here"/models/* "$out"/
fi
exit 0
)sh");
  std::filesystem::permissions(script, std::filesystem::perms::owner_all);
  return script.string();
}

}  // namespace editnerf
