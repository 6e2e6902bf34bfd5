// COLMAP, a separate program: features, matching and mapping of one camera's images, on the CPU.
//
// Option names differ between versions (3.13 renamed SiftExtraction.use_gpu to FeatureExtraction.use_gpu, for example),
// so the installed program's own help is read first and only options that it knows are given.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace editnerf {

struct ColmapOptions {
  std::string program = "colmap";              // a path, or a name on PATH
  std::string camera_model = "SIMPLE_RADIAL";  // or OPENCV, RADIAL, PINHOLE, SIMPLE_PINHOLE
  int64_t threads = 0;                         // 0: all that this process may use
  int64_t seed = 0;
  int64_t exhaustive_limit = 40;  // images up to which every pair is matched
  int64_t neighbours = 10;        // beyond: each image with this many after it, and ...
  int64_t loop_images = 20;       // ... every pair among this many evenly spaced images
};

struct ColmapResult {
  std::vector<std::filesystem::path> models;            // the mapper's sub-models, the largest first
  std::vector<std::pair<std::string, double>> seconds;  // per stage, in order
};

// image_names lie in image_folder, in time order. work_folder receives the database, the models (sparse/0, ...) and
// colmap.log; an earlier database and models there are removed. `models` is empty where the mapper found no model.
// Throws DataError where COLMAP is absent or a stage fails (with the log's path and last line), Interrupted on Ctrl-C.
ColmapResult RunColmap(const std::filesystem::path& image_folder, const std::vector<std::string>& image_names,
                       const std::filesystem::path& work_folder, const ColmapOptions& options);

// Pairs (i < j) that are matched among `count` images in time order: all up to the limit; beyond it neighbours, powers
// of two apart further on, and all pairs of evenly spaced images, which close loops.
std::vector<std::pair<int64_t, int64_t>> ImagePairs(int64_t count, const ColmapOptions& options);

}  // namespace editnerf
