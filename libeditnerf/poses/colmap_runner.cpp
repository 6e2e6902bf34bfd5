#include "libeditnerf/poses/colmap_runner.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <functional>
#include <set>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/progress.h"
#include "libeditnerf/imaging/importers/colmap_model.h"
#include "libeditnerf/poses/child_process.h"

namespace editnerf {
namespace fs = std::filesystem;
namespace {

using Arguments = std::vector<std::pair<std::string, std::string>>;  // option without dashes, value

class Runner {
 public:
  Runner(const ColmapOptions& options, const fs::path& work) : options_(options), work_(work) {}

  // Runs one COLMAP command with those of the options that it knows; returns the exit code.
  int Run(const std::string& command, const Arguments& arguments,
          const std::function<void(const std::string&)>& on_line) {
    const std::set<std::string> known = KnownOptions(command);
    ChildProcess child = Child(command, log());
    for (const auto& [name, value] : arguments) {
      if (known.count(name) == 0) continue;
      child.arguments.push_back("--" + name);
      child.arguments.push_back(value);
    }
    child.on_line = on_line;
    return RunChild(child);
  }

  fs::path log() const { return work_ / "colmap.log"; }

  [[noreturn]] void Fail(const std::string& stage, int exit_code) const {
    std::string text = ReadFile(log());
    while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())) != 0) text.pop_back();
    const size_t line = text.find_last_of("\r\n");
    Throw<DataError>("COLMAP's {} failed with exit code {}: '{}'; its output is in {}", stage, exit_code,
                     line == std::string::npos ? text : text.substr(line + 1), log().string());
  }

 private:
  ChildProcess Child(const std::string& command, const fs::path& log) const {
    ChildProcess child;
    child.arguments = {options_.program, command};
    child.environment = {{"QT_QPA_PLATFORM", "offscreen"}};  // COLMAP is linked with Qt and may have no display
    child.log = log;
    return child;
  }

  // The names after "--" in the command's help.
  std::set<std::string> KnownOptions(const std::string& command) const {
    const fs::path help = work_ / ("help_" + command + ".txt");
    std::error_code ignored;
    fs::remove(help, ignored);
    ChildProcess child = Child(command, help);
    child.arguments.push_back("-h");
    try {
      RunChild(child);
    } catch (const DataError& error) {
      Throw<DataError>(
          "{}; COLMAP finds the camera poses: install it (apt-get install colmap), or give a solved model with "
          "--colmap-model",
          error.what());
    }
    const std::string text = ReadFile(help);
    fs::remove(help, ignored);
    std::set<std::string> known;
    for (size_t at = text.find("--"); at != std::string::npos; at = text.find("--", at)) {
      at += 2;
      const size_t start = at;
      const auto part_of_name = [&](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.';
      };
      while (at < text.size() && part_of_name(text[at])) ++at;
      known.insert(text.substr(start, at - start));
    }
    return known;
  }

  const ColmapOptions& options_;
  fs::path work_;
};

std::string PairList(const std::vector<std::string>& names, const ColmapOptions& options) {
  std::string list;
  for (const auto& [i, j] : ImagePairs(static_cast<int64_t>(names.size()), options)) {
    list += names[static_cast<size_t>(i)] + " " + names[static_cast<size_t>(j)] + "\n";
  }
  return list;
}

// Every use_gpu and num_threads that a version has had.
Arguments Common(const char* old_group, const char* new_group, int64_t threads) {
  Arguments common;
  for (const std::string group : {old_group, new_group}) {
    common.emplace_back(group + ".use_gpu", "0");
    common.emplace_back(group + ".num_threads", std::to_string(threads));
  }
  return common;
}

Arguments operator+(Arguments a, const Arguments& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

std::vector<fs::path> Models(const fs::path& folder) {
  std::vector<std::pair<int64_t, fs::path>> found;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (IsColmapModel(entry.path())) found.emplace_back(-CountColmapImages(entry.path()), entry.path());
  }
  std::sort(found.begin(), found.end());
  std::vector<fs::path> models;
  for (const auto& model : found) models.push_back(model.second);
  return models;
}

}  // namespace

std::vector<std::pair<int64_t, int64_t>> ImagePairs(int64_t count, const ColmapOptions& options) {
  std::set<std::pair<int64_t, int64_t>> pairs;
  const bool all = count <= options.exhaustive_limit;
  for (int64_t i = 0; i < count; ++i) {
    const int64_t end = all ? count : std::min(count, i + 1 + options.neighbours);
    for (int64_t j = i + 1; j < end; ++j) pairs.emplace(i, j);
    for (int64_t step = 2 * options.neighbours; i + step < count; step *= 2) pairs.emplace(i, i + step);
  }
  const int64_t spaced = std::min(count, options.loop_images);
  for (int64_t a = 0; a < spaced; ++a) {
    for (int64_t b = a + 1; b < spaced; ++b) pairs.emplace(a * count / spaced, b * count / spaced);
  }
  return {pairs.begin(), pairs.end()};
}

ColmapResult RunColmap(const fs::path& image_folder, const std::vector<std::string>& image_names,
                       const fs::path& work_folder, const ColmapOptions& options) {
  MakeFolder(work_folder);
  const fs::path database = work_folder / "database.db", sparse = work_folder / "sparse";
  const fs::path pair_list = work_folder / "pairs.txt", image_list = work_folder / "images.txt";
  std::error_code ignored;
  for (const fs::path& stale : {database, sparse, work_folder / "colmap.log"}) fs::remove_all(stale, ignored);
  MakeFolder(sparse);
  std::string names;
  for (const std::string& name : image_names) names += name + "\n";
  WriteFileAtomically(image_list, names);
  const std::string pairs = PairList(image_names, options);
  WriteFileAtomically(pair_list, pairs);

  Runner runner(options, work_folder);
  ColmapResult result;
  Stopwatch clock;
  const int64_t threads = options.threads > 0 ? options.threads : NumThreads();
  const Arguments paths = {{"database_path", database.string()},
                           {"image_path", image_folder.string()},
                           {"random_seed", std::to_string(options.seed)},
                           {"default_random_seed", std::to_string(options.seed)}};
  const auto total = static_cast<double>(image_names.size());
  // Runs one stage; lines of its output with the marker report progress.
  const auto stage = [&](const std::string& label, const std::string& command, const Arguments& arguments,
                         const std::string& marker) {
    Progress progress(label, 1);
    const double start = clock.Seconds();
    double counted = 0, share = 0;
    const int code = runner.Run(command, paths + arguments, [&](const std::string& line) {
      const size_t at = line.find(marker);
      if (at == std::string::npos) return;
      double a = ++counted, b = total;  // lines, one for each image
      double first = 0, last = 0;
      if (std::sscanf(line.c_str() + at + marker.size(), " [%lf/%lf", &first, &last) == 2 && last > 0) {
        a = first - 1;  // the line announces the item that begins
        b = last;
      }
      share = std::max(share, std::min(1.0, a / b));
      progress.Update(share);
    });
    progress.Finish();
    result.seconds.emplace_back(label, clock.Seconds() - start);
    return code;
  };

  int code = stage("features", "feature_extractor",
                   Common("SiftExtraction", "FeatureExtraction", threads) +
                       Arguments{{"image_list_path", image_list.string()},
                                 {"ImageReader.single_camera", "1"},
                                 {"ImageReader.camera_model", options.camera_model}},
                   "Processed file");
  if (code != 0) runner.Fail("feature extraction", code);
  code = stage("matching", "matches_importer",
               Common("SiftMatching", "FeatureMatching", threads) +
                   Arguments{{"match_list_path", pair_list.string()}, {"match_type", "pairs"}},
               "Matching block");
  if (code != 0) runner.Fail("matching", code);
  // A global adjustment when the model has grown by kGrowth, not at every tenth: half the time, the same poses.
  constexpr const char* kGrowth = "1.4";
  code = stage("mapping", "mapper",
               {{"output_path", sparse.string()},
                {"Mapper.num_threads", std::to_string(threads)},
                {"Mapper.ba_global_images_ratio", kGrowth},
                {"Mapper.ba_global_points_ratio", kGrowth},
                {"Mapper.ba_global_frames_ratio", kGrowth}},
               "Registering image");
  result.models = Models(sparse);
  // The mapper also fails where it finds no pair to start from; the caller reports that as no image registered.
  if (code > 1 && result.models.empty()) runner.Fail("mapping", code);
  return result;
}

}  // namespace editnerf
