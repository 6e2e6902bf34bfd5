#include "libeditnerf/poses/solve_poses.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "libeditnerf/base/clock.h"
#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/logging.h"
#include "libeditnerf/imaging/camera_file.h"
#include "libeditnerf/imaging/importers/colmap_model.h"
#include "libeditnerf/imaging/importers/llff.h"
#include "libeditnerf/imaging/importers/transforms_json.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/imaging/scene_folder_writer.h"
#include "libeditnerf/poses/frame_source.h"
#include "libeditnerf/poses/scene_bounds.h"

namespace editnerf {
namespace fs = std::filesystem;
namespace {

constexpr const char* kCaptureAdvice =
    "the camera must move sideways (not only turn), over a still, textured background, with much overlap between "
    "neighbouring frames; take more frames (--max-frames) or a slower, sharper video";

// A solved source: its frames in time order, each with the id under which its image was copied.
struct Solved {
  ImportedModel model;
  std::vector<std::string> ids;  // of model.frames
};

// The input's images where it is a folder of images.
std::vector<fs::path> ImagesOf(const fs::path& folder) {
  std::vector<fs::path> images = ListImages(folder);
  if (images.empty() && fs::is_directory(folder / "images")) images = ListImages(folder / "images");
  if (images.empty()) {
    Throw<DataError>("{}: expected a video or a folder of images (.png, .jpg, ...), found no image", folder.string());
  }
  return images;
}

CopiedFrames CopyInput(const fs::path& input, const fs::path& scene_folder, int64_t max_frames) {
  if (!fs::exists(input)) Throw<DataError>("{}: no such file or folder", input.string());
  if (!fs::is_directory(input)) return CopyVideoFrames(input, max_frames, scene_folder);
  return CopyImages(EvenlySpaced(ImagesOf(input), max_frames), scene_folder);
}

// Keeps the frames whose image was copied, under their ids; the model's names are ID.png or the original names.
Solved Identify(ImportedModel model, const CopiedFrames& copied) {
  std::map<std::string, std::string> id_of;
  for (size_t i = 0; i < copied.ids.size(); ++i) {
    id_of[copied.ids[i] + ".png"] = copied.ids[i];
    if (!copied.names[i].empty()) id_of[copied.names[i]] = copied.ids[i];
  }
  std::vector<std::pair<std::string, ImportedFrame>> found;
  for (ImportedFrame& frame : model.frames) {
    const auto id = id_of.find(fs::path(frame.name).filename().string());
    if (id != id_of.end()) found.emplace_back(id->second, std::move(frame));
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  Solved solved;
  model.frames.clear();
  for (auto& [id, frame] : found) {
    solved.ids.push_back(id);
    model.frames.push_back(std::move(frame));
  }
  solved.model = std::move(model);
  return solved;
}

// A camera solved at another resolution than the images is brought to theirs.
void FitCameras(const CopiedFrames& copied, Solved* solved) {
  for (ImportedFrame& frame : solved->model.frames) {
    Camera& camera = frame.camera;
    if (camera.width == copied.width && camera.height == copied.height) continue;
    const double sx = static_cast<double>(copied.width) / static_cast<double>(camera.width);
    const double sy = static_cast<double>(copied.height) / static_cast<double>(camera.height);
    if (std::abs(sx / sy - 1) > 0.02) {
      Throw<DataError>("{}: its camera has {} x {} pixels, but the image has {} x {}, another shape", frame.name,
                       camera.width, camera.height, copied.width, copied.height);
    }
    camera = camera.Resized(copied.width, copied.height);
  }
}

void WriteScene(const Solved& solved, const fs::path& folder, PosesReport* report) {
  Scene scene;
  scene.name = folder.filename().string();
  scene.transform = EstimateSceneTransform(solved.model);
  for (size_t i = 0; i < solved.ids.size(); ++i) {
    SceneFrame frame;
    frame.id = solved.ids[i];
    frame.warp_id = frame.appearance_id = static_cast<int64_t>(i);
    frame.camera = CameraInSceneUnits(solved.model.frames[i].camera, scene.transform);
    scene.frames.push_back(frame);
    scene.train.push_back(static_cast<int64_t>(i));
  }
  const torch::Tensor& points = solved.model.points;
  if (points.defined() && points.size(0) > 0) {
    const Vec3& c = scene.transform.center;
    const torch::Tensor center = torch::tensor({c.x, c.y, c.z}, torch::kFloat64);
    scene.points = (points - center) * scene.transform.scale;
    report->num_points = points.size(0);
  }
  report->near = scene.transform.near;
  report->far = scene.transform.far;
  WriteSceneDescription(scene, folder);
}

void WriteReport(const PosesReport& report, const fs::path& path) {
  Json seconds = Json::object();
  for (const auto& [stage, value] : report.seconds) seconds[stage] = value;
  Json json = {{"source", report.source},
               {"total_frames", report.total},
               {"registered_frames", report.registered},
               {"missing", report.missing},
               {"points", report.num_points},
               {"near", report.near},
               {"far", report.far},
               {"seconds", seconds}};
  if (std::isfinite(report.mean_reprojection_error)) {
    json["mean_reprojection_error_px"] = report.mean_reprojection_error;
  } else {
    json["mean_reprojection_error_px"] = nullptr;
  }
  WriteJson(path, json);
}

// The file or folder as an already solved NeRF or LLFF data set, if it is one.
bool ReadSolvedDataSet(const fs::path& input, ImportedModel* model, std::string* source) {
  fs::path transforms;
  if (input.extension() == ".json") transforms = input;
  for (const char* name : {"transforms_train.json", "transforms.json"}) {
    if (fs::is_directory(input) && fs::exists(input / name)) transforms = input / name;
  }
  if (!transforms.empty()) {
    *model = ReadTransformsJson(transforms);
    *source = "transforms.json";
    return true;
  }
  if (fs::is_directory(input) && fs::exists(input / "poses_bounds.npy")) {
    *model = ReadLlffPoses(input / "poses_bounds.npy", input / "images");
    *source = "LLFF";
    return true;
  }
  return false;
}

// Runs COLMAP on the copied frames; a model without frames where it registered none.
ImportedModel RunOnFrames(const CopiedFrames& copied, const fs::path& scene_folder, const ColmapOptions& options,
                          PosesReport* report) {
  std::vector<std::string> names;
  for (const std::string& id : copied.ids) names.push_back(id + ".png");
  const fs::path images = scene_folder / "rgb" / "1x";
  const ColmapResult result = RunColmap(images, names, scene_folder / "colmap", options);
  report->seconds.insert(report->seconds.end(), result.seconds.begin(), result.seconds.end());
  if (result.models.size() > 1) {
    LogWarning("COLMAP split the frames into {} separate models; the largest one is used", result.models.size());
  }
  return result.models.empty() ? ImportedModel() : ReadColmapModel(result.models[0], images);
}

void CheckRegistered(const Solved& solved, const CopiedFrames& copied, double min_share, const std::string& log_note,
                     PosesReport* report) {
  const std::set<std::string> registered(solved.ids.begin(), solved.ids.end());
  for (const std::string& id : copied.ids) {
    if (registered.count(id) == 0) report->missing.push_back(id);
  }
  report->total = static_cast<int64_t>(copied.ids.size());
  report->registered = static_cast<int64_t>(registered.size());
  const auto share = static_cast<double>(report->registered) / static_cast<double>(report->total);
  if (report->registered < 2 || share < min_share) {
    Throw<DataError>("{} registered only {} of {} frames, expected at least {:.0f} %: {}{}", report->source,
                     report->registered, report->total, 100 * min_share, kCaptureAdvice, log_note);
  }
  if (!report->missing.empty()) {
    LogWarning("{} registered {} of {} frames; continuing without the others", report->source, report->registered,
               report->total);
  }
}

}  // namespace

PosesReport SolvePoses(const fs::path& input, const fs::path& scene_folder, const SolvePosesOptions& options) {
  if (options.max_frames < 2) Throw<ConfigError>("max_frames: expected at least 2, found {}", options.max_frames);
  if (!fs::exists(input)) Throw<DataError>("{}: no such file or folder", input.string());
  if (fs::exists(input / "dataset.json")) {
    Throw<ConfigError>("{}: is a scene folder already; its poses are solved", input.string());
  }
  if (fs::exists(scene_folder / "dataset.json") && !options.force) {
    Throw<ConfigError>("{}: holds a scene already; --force replaces it", scene_folder.string());
  }
  std::error_code ignored;
  if (fs::equivalent(input, scene_folder, ignored) || fs::equivalent(input, scene_folder / "rgb" / "1x", ignored)) {
    Throw<ConfigError>("{}: the scene cannot be written into its own input; choose another --out",
                       scene_folder.string());
  }
  MakeFolder(scene_folder);
  RemoveStaleSceneFiles(scene_folder);

  PosesReport report;
  Stopwatch clock;
  double start = 0;
  const auto finish_stage = [&](const char* stage) {
    report.seconds.emplace_back(stage, clock.Seconds() - start);
    start = clock.Seconds();
  };
  ImportedModel model;
  CopiedFrames copied;
  const bool solved_already = options.colmap_model.empty() && ReadSolvedDataSet(input, &model, &report.source);
  if (solved_already) {
    std::vector<fs::path> images;
    for (const ImportedFrame& frame : model.frames) images.push_back(frame.image_path);
    copied = CopyImages(images, scene_folder);
    // Its frames are the copied ones, one to one; their own names need not be distinct.
    for (size_t i = 0; i < copied.ids.size(); ++i) model.frames[i].name = copied.ids[i] + ".png";
    std::fill(copied.names.begin(), copied.names.end(), "");
    finish_stage("frames");
  } else {
    // A solved model was made of the whole folder, so all of its images are taken.
    const int64_t max_frames = options.colmap_model.empty() ? options.max_frames : int64_t{1} << 40;
    copied = CopyInput(input, scene_folder, max_frames);
    finish_stage("frames");
    report.source = options.colmap_model.empty() ? "COLMAP" : "COLMAP model";
    if (copied.ids.size() < 2) {
      Throw<DataError>("{}: expected at least two frames, found {}; one view alone does not determine a scene",
                       input.string(), copied.ids.size());
    }
    model = options.colmap_model.empty() ? RunOnFrames(copied, scene_folder, options.colmap, &report)
                                         : ReadColmapModel(options.colmap_model, input);
    start = clock.Seconds();
  }
  report.mean_reprojection_error = model.mean_reprojection_error;
  Solved solved = Identify(std::move(model), copied);
  const std::string log_note =
      report.source == "COLMAP" ? "; its output is in " + (scene_folder / "colmap" / "colmap.log").string() : "";
  CheckRegistered(solved, copied, options.min_registered_share, log_note, &report);
  FitCameras(copied, &solved);
  WriteScene(solved, scene_folder, &report);
  finish_stage("scene");
  WriteReport(report, scene_folder / "poses_report.json");
  LogInfo("{}: {} of {} frames registered, mean reprojection error {:.2f} px, {} points", report.source,
          report.registered, report.total, report.mean_reprojection_error, report.num_points);
  return report;
}

}  // namespace editnerf
