#include "libeditnerf/imaging/truth_files.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/file.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/imaging/image_file.h"
#include "libeditnerf/imaging/json_file.h"
#include "libeditnerf/imaging/npy_file.h"
#include "libeditnerf/imaging/scene_images.h"

namespace editnerf {
namespace fs = std::filesystem;
namespace {

constexpr double kRotationTolerance = 1e-3;
constexpr int64_t kMaxObjects = 255;  // that a mask of 8 bits tells apart

// A rigid motion, row-major 4 x 4, between world and scene units.
struct Motion {
  Mat3 rotation;
  Vec3 translation;
};

Motion MotionFromJson(const Json& matrix, const std::string& where) {
  const auto m = JsonMatrix(matrix, 4, 4, where);
  Motion motion;
  motion.rotation = {{m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}};
  motion.translation = {m[3], m[7], m[11]};
  const Mat3 product = motion.rotation * motion.rotation.Transposed();
  double deviation = std::abs(m[12]) + std::abs(m[13]) + std::abs(m[14]) + std::abs(m[15] - 1);
  for (int i = 0; i < 9; ++i) deviation = std::max(deviation, std::abs(product.m[i] - (i % 4 == 0 ? 1.0 : 0.0)));
  if (deviation > kRotationTolerance) {
    Throw<DataError>("{}: expected a rigid motion with last row 0 0 0 1; it is off by {:.2g}", where, deviation);
  }
  return motion;
}

void StoreMotion(const Motion& world, const SceneTransform& transform, double* out) {
  const Vec3 t = (world.rotation * transform.center + world.translation - transform.center) * transform.scale;
  const auto& r = world.rotation.m;
  const double rows[16] = {r[0], r[1], r[2], t.x, r[3], r[4], r[5], t.y, r[6], r[7], r[8], t.z, 0, 0, 0, 1};
  std::copy(rows, rows + 16, out);
}

Json MotionToJson(const double* m, const SceneTransform& transform) {
  const Mat3 r = {{m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}};
  const Vec3 t = Vec3{m[3], m[7], m[11]} / transform.scale - r * transform.center + transform.center;
  return {{r.m[0], r.m[1], r.m[2], t.x}, {r.m[3], r.m[4], r.m[5], t.y}, {r.m[6], r.m[7], r.m[8], t.z}, {0, 0, 0, 1}};
}

torch::Tensor ReadDepth(const fs::path& path) {
  if (!fs::exists(path))
    Throw<DataError>("{}: no such file; every frame of gt/motion.json needs its depth", path.string());
  const torch::Tensor depth = ReadNpy(path);
  if (depth.dim() != 2 || !depth.is_floating_point()) {
    Throw<DataError>("{}: expected [H, W] floating point numbers, found {}", path.string(), ShapeString(depth));
  }
  if (!depth.gt(0).all().item<bool>()) {  // also false for NaN
    Throw<DataError>("{}: expected positive distances (inf where nothing is hit), found zero, negative or NaN",
                     path.string());
  }
  return depth.to(torch::kFloat32);
}

// One picture per frame, `read` by several threads and resized by nearest neighbour.
torch::Tensor ReadStack(const fs::path& gt, const char* what, const std::vector<std::string>& ids, int64_t height,
                        int64_t width, torch::ScalarType type,
                        const std::function<torch::Tensor(const std::string&)>& read) {
  const auto count = static_cast<int64_t>(ids.size());
  torch::Tensor stack = torch::empty({count, height, width}, type);
  ParallelFor(count, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const std::string& id = ids[static_cast<size_t>(i)];
      const torch::Tensor picture = read(id);
      const int64_t h = picture.size(0), w = picture.size(1);
      // The images' sides were rounded after division by the factor.
      const bool same = h == height && w == width;
      const bool larger = h > height && w > width && 2 * std::abs(h * width - w * height) <= h + w;
      if (!same && !larger) {
        Throw<DataError>("{}: {} of frame '{}' has {} x {} pixels, which does not fit images of {} x {}", gt.string(),
                         what, id, w, h, width, height);
      }
      stack[i].copy_(ResizeByNearest(picture, height, width));
    }
  });
  return stack;
}

}  // namespace

std::vector<std::string> ReadEditIds(const fs::path& folder) {
  const fs::path path = folder / "gt" / "edits.json";
  if (!fs::exists(path)) return {};
  return JsonStrings(ReadJson(path), "ids", path.string());
}

void WriteEditIds(const fs::path& folder, const std::vector<std::string>& ids) {
  MakeFolder(folder / "gt");
  WriteJson(folder / "gt" / "edits.json", {{"ids", ids}});
}

bool HasTruth(const fs::path& folder) { return fs::exists(folder / "gt" / "motion.json"); }

GroundTruth ReadTruth(const fs::path& folder, const std::vector<std::string>& ids, const SceneTransform& transform,
                      int64_t height, int64_t width) {
  GroundTruth truth;
  const fs::path motion_path = folder / "gt" / "motion.json";
  const Json motion = ReadJson(motion_path);
  truth.objects = JsonStrings(motion, "objects", motion_path.string());
  const Json& frames = JsonField(motion, "frames", motion_path.string());
  const auto count = static_cast<int64_t>(ids.size()), objects = static_cast<int64_t>(truth.objects.size());
  if (objects > kMaxObjects) {
    Throw<DataError>("{}: objects: expected at most {}, found {}", motion_path.string(), kMaxObjects, objects);
  }
  truth.scene_from_object = torch::empty({count, objects, 4, 4}, torch::kFloat64);
  auto* out = truth.scene_from_object.data_ptr<double>();
  for (const std::string& id : ids) {
    const Json& frame = JsonField(frames, id, motion_path.string() + ": frames");
    for (const std::string& object : truth.objects) {
      const std::string where = motion_path.string() + ": frame " + id;
      StoreMotion(MotionFromJson(JsonField(frame, object, where), where + ": " + object), transform, out);
      out += 16;
    }
  }
  if (fs::is_directory(folder / "gt" / "depth")) {
    truth.depth = ReadStack(folder / "gt", "depth", ids, height, width, torch::kFloat32, [&](const std::string& id) {
      return ReadDepth(folder / "gt" / "depth" / (id + ".npy")) * transform.scale;
    });
  }
  if (fs::is_directory(folder / "gt" / "mask")) {
    truth.mask = ReadStack(folder / "gt", "mask", ids, height, width, torch::kUInt8, [&](const std::string& id) {
      const fs::path path = folder / "gt" / "mask" / (id + ".png");
      torch::Tensor mask = ReadMask(path);
      if (mask.max().item<int64_t>() > objects) {
        Throw<DataError>("{}: value {}, expected at most {}, the number of objects in gt/motion.json", path.string(),
                         mask.max().item<int64_t>(), objects);
      }
      return mask;
    });
  }
  return truth;
}

void WriteTruth(const fs::path& folder, const std::vector<std::string>& ids, const GroundTruth& truth,
                const SceneTransform& transform) {
  const auto count = static_cast<int64_t>(ids.size()), objects = static_cast<int64_t>(truth.objects.size());
  CheckShape(truth.scene_from_object, {count, objects, 4, 4}, "truth.scene_from_object");
  const torch::Tensor motions = truth.scene_from_object.to(torch::kCPU, torch::kFloat64).contiguous();
  const auto* m = motions.data_ptr<double>();
  Json frames = Json::object();
  for (const std::string& id : ids) {
    frames[id] = Json::object();
    for (const std::string& object : truth.objects) {
      frames[id][object] = MotionToJson(m, transform);
      m += 16;
    }
  }
  const fs::path gt = folder / "gt";
  MakeFolder(gt);
  WriteJson(gt / "motion.json", {{"objects", truth.objects}, {"frames", frames}});
  if (truth.depth.defined()) {
    CheckShape(truth.depth, {count, kAny, kAny}, "truth.depth");
    MakeFolder(gt / "depth");
    for (int64_t i = 0; i < count; ++i) {
      const torch::Tensor world = truth.depth[i].to(torch::kFloat64) / transform.scale;
      WriteNpy(gt / "depth" / (ids[static_cast<size_t>(i)] + ".npy"), world.to(torch::kFloat32));
    }
  }
  if (truth.mask.defined()) {
    CheckShape(truth.mask, {count, kAny, kAny}, "truth.mask");
    MakeFolder(gt / "mask");
    for (int64_t i = 0; i < count; ++i) {
      WritePng(gt / "mask" / (ids[static_cast<size_t>(i)] + ".png"), truth.mask[i]);
    }
  }
}

}  // namespace editnerf
