#include "libeditnerf/kernels/fused_rays.h"

#include <ATen/Functions.h>

#include <algorithm>
#include <atomic>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"

namespace editnerf {
namespace {

constexpr int64_t kPartsPerThread = 4;  // of the rays of a step, to even out their cost
constexpr int64_t kGrain = 128;         // rays of a picture

// Sizes of everything that workers and parts hold: those of the field's parameters.
std::vector<int64_t> SizesOf(const FusedField& field) {
  std::vector<int64_t> sizes = {field.num_key_points,  field.code_dim,       field.appearance_dim,  field.use_direction,
                                field.ambient_octaves, field.weight_octaves, field.slicing_octaves, field.local_frames};
  const auto add = [&](const at::Tensor& tensor) {
    for (int64_t d = 0; tensor.defined() && d < tensor.dim(); ++d) sizes.push_back(tensor.size(d));
  };
  add(field.canonical.table);
  add(field.local.table);
  add(field.shade.table);
  for (const MlpLayers* layers : {&field.density, &field.color, &field.weights, &field.slicing}) {
    for (const at::Tensor& weight : layers->weights) add(weight);
  }
  return sizes;
}

// Floats of a ray's row in to_states_.
struct StateRow {
  int64_t keys, frames, code, appearance, size;
  explicit StateRow(const FusedField& field)
      : keys(0),
        frames(3 * field.num_key_points),
        code(frames + (field.local_frames ? 9 * field.num_key_points : 0)),
        appearance(code + field.code_dim),
        size(appearance + field.appearance_dim) {}
};

void AddTable(const std::vector<float>& rows, const StateRow& row, int64_t first, int64_t width,
              const BundledRays& rays, at::IntArrayRef shape, at::Tensor* to) {
  if (width == 0) return;
  if (!to->defined()) *to = at::zeros(shape, at::kFloat);
  float* const table = to->data_ptr<float>();
  for (int64_t r = 0; r < rays.count; ++r) {
    const float* const from = rows.data() + r * row.size + first;
    float* const sum = table + rays.state[r] * width;
    for (int64_t i = 0; i < width; ++i) sum[i] += from[i];
  }
}

}  // namespace

// What a thread works with.
struct FusedRays::Worker {
  std::vector<int64_t> sizes;
  RayBundle bundle;
  RayShading shading;
  PackedTiles returning;  // samples on their way back, of one bundle after the other
  TileMemory scratch, to_keys, to_frames, to_code, to_appearance;

  explicit Worker(const FieldKernel& field)
      : sizes(SizesOf(field.field())),
        bundle(field.rows()),
        returning(field.rows().count, field.rows().for_backward),
        scratch(field.scratch_rows()),
        to_keys(3 * field.field().num_key_points),
        to_frames(field.field().local_frames ? 9 * field.field().num_key_points : 0),
        to_code(field.field().code_dim),
        to_appearance(field.field().appearance_dim) {}
  bool Fits(const FieldKernel& field) const { return sizes == SizesOf(field.field()); }
};

// A share of a step's rays, and what they add to the gradients.
struct FusedRays::Part {
  std::vector<int64_t> sizes;
  FieldSums sums;
  FeatureGradients features;
  RayLossSums losses;
  int64_t begin = 0, end = 0;

  explicit Part(const FieldKernel& field)
      : sizes(SizesOf(field.field())), sums(field.MakeSums()), features(field.rows(), field.field().num_key_points) {}
  bool Fits(const FieldKernel& field) const { return sizes == SizesOf(field.field()); }
};

// A worker that nobody else uses, until this goes.
class FusedRays::Lease {
 public:
  Lease(FusedRays& owner, const FieldKernel& field) : owner_(owner) {
    {
      const std::lock_guard<std::mutex> lock(owner_.mutex_);
      if (!owner_.idle_.empty()) {
        worker_ = std::move(owner_.idle_.back());
        owner_.idle_.pop_back();
      }
    }
    if (worker_ == nullptr || !worker_->Fits(field)) worker_ = std::make_unique<Worker>(field);
  }
  ~Lease() {
    const std::lock_guard<std::mutex> lock(owner_.mutex_);
    owner_.idle_.push_back(std::move(worker_));
  }
  Lease(const Lease&) = delete;
  Lease& operator=(const Lease&) = delete;
  Worker& operator*() { return *worker_; }

 private:
  FusedRays& owner_;
  std::unique_ptr<Worker> worker_;
};

FusedRays::FusedRays() = default;
FusedRays::~FusedRays() = default;

void FusedRays::TrainPart(const FieldKernel& field, const BundledRays& rays, const RayLoss& loss, Part& part) {
  Lease lease(*this, field);
  Worker& worker = *lease;
  const FieldRows& rows = field.rows();
  worker.returning.Clear();
  part.sums.Clear();
  part.features.Clear();
  part.losses = {};
  for (int64_t next = part.begin; next < part.end;) {
    next = worker.bundle.Fill(field, rays, /*for_gradients=*/true, next, part.end);
    worker.shading.Train(field, rays, loss, worker.bundle, &part.losses);
    for (int64_t i = 0; i < worker.bundle.num_tiles(); ++i) {
      RayBundle::Tile& tile = worker.bundle.tile(i);
      // Slots are a bundle's own; from here on samples of several lie side by side.
      float* const slots = tile.memory.Row(rows.slot);
      for (int64_t s = 0; s < tile.count; ++s)
        slots[s] = static_cast<float>(worker.bundle.Ray(static_cast<int64_t>(slots[s])) - part.begin);
      worker.returning.Append(tile.memory.Row(rows.chosen), tile.memory, tile.count);
      if (worker.returning.full()) GoBack(field, worker, part);
    }
  }
  if (worker.returning.count() > 0) GoBack(field, worker, part);
}

// The gradients of a tile of samples.
void FusedRays::GoBack(const FieldKernel& field, Worker& worker, Part& part) {
  const FieldRows& rows = field.rows();
  const StateRow state_row(field.field());
  const int64_t count = worker.returning.count();
  TileMemory& tile = worker.returning.tile();
  const FeatureGradients::Tile features = part.features.Next(count);
  std::copy_n(tile.Row(rows.unit), 3 * kTileStride, features.unit);
  if (rows.local_features > 0) std::copy_n(tile.Row(rows.local), 3 * kTileStride, features.local);
  if (rows.shade_features > 0) {
    std::copy_n(tile.Row(rows.shade_unit), 3 * field.field().num_key_points * kTileStride, features.shade);
  }
  const TileGradients to = {features.canonical,         features.locals,         features.shades,
                            worker.to_keys.rows(),      worker.to_frames.rows(), worker.to_code.rows(),
                            worker.to_appearance.rows()};
  field.Backward(count, tile, worker.scratch, part.sums, to);
  const float* const slots = tile.Row(rows.slot);
  for (int64_t s = 0; s < count; ++s) {
    float* const sum = to_states_.data() + (part.begin + static_cast<int64_t>(slots[s])) * state_row.size;
    const auto add = [&](const TileMemory& from, int64_t first, int64_t width) {
      for (int64_t k = 0; k < width; ++k) sum[first + k] += from.Row(k)[s];
    };
    add(worker.to_keys, state_row.keys, state_row.frames);
    add(worker.to_frames, state_row.frames, state_row.code - state_row.frames);
    add(worker.to_code, state_row.code, field.field().code_dim);
    add(worker.to_appearance, state_row.appearance, field.field().appearance_dim);
  }
  worker.returning.Next();
}

RayLossSums FusedRays::AddGradients(const FieldKernel& field, const BundledRays& rays, const RayLoss& loss,
                                    FusedStates* states) {
  const auto num_parts = static_cast<size_t>(std::min(rays.count, kPartsPerThread * NumThreads()));
  if (!parts_.empty() && !parts_.front()->Fits(field)) parts_.clear();
  while (parts_.size() < num_parts) parts_.push_back(std::make_unique<Part>(field));
  to_states_.assign(static_cast<size_t>(rays.count * StateRow(field.field()).size), 0.0F);
  ParallelFor(static_cast<int64_t>(num_parts), 1, [&](int64_t first, int64_t last) {
    for (int64_t p = first; p < last; ++p) {
      Part& part = *parts_[static_cast<size_t>(p)];
      part.begin = rays.count * p / static_cast<int64_t>(num_parts);
      part.end = rays.count * (p + 1) / static_cast<int64_t>(num_parts);
      TrainPart(field, rays, loss, part);
    }
  });
  RayLossSums losses;
  std::vector<const FeatureGradients*> features;
  for (size_t p = 0; p < num_parts; ++p) {
    losses.Add(parts_[p]->losses);
    features.push_back(&parts_[p]->features);
    if (p > 0) parts_[0]->sums.Add(parts_[p]->sums);
  }
  if (num_parts > 0) field.AddToGradients(parts_[0]->sums);
  ScatterToTables(field.field(), features);
  AddToStates(field, rays, states);
  return losses;
}

void FusedRays::AddToStates(const FieldKernel& field, const BundledRays& rays, FusedStates* states) const {
  const FusedField& f = field.field();
  const StateRow row(f);
  const int64_t count = field.num_states();
  AddTable(to_states_, row, row.keys, row.frames, rays, {count, f.num_key_points, 3}, &states->key_points);
  AddTable(to_states_, row, row.frames, row.code - row.frames, rays, {count, f.num_key_points, 3, 3},
           &states->local_frames);
  AddTable(to_states_, row, row.code, f.code_dim, rays, {count, f.code_dim}, &states->warp_code);
  AddTable(to_states_, row, row.appearance, f.appearance_dim, rays, {count, f.appearance_dim}, &states->appearance);
}

int64_t FusedRays::Show(const FieldKernel& field, const BundledRays& rays, const RayPicture& picture) {
  std::atomic<int64_t> samples{0};
  ParallelFor(rays.count, kGrain, [&](int64_t begin, int64_t end) {
    Lease lease(*this, field);
    for (int64_t next = begin; next < end;) {
      next = (*lease).bundle.Fill(field, rays, /*for_gradients=*/false, next, end);
      samples += (*lease).shading.Show(field, rays, picture, (*lease).bundle);
    }
  });
  return samples;
}

at::Tensor FusedDensity(const FieldKernel& field, const at::Tensor& x, const at::Tensor& state) {
  CheckShape(x, {kAny, 3}, "fused density x");
  CheckShape(state, {x.size(0)}, "fused density state");
  const at::Tensor points = x.to(at::kFloat).contiguous(), states = state.contiguous();
  at::Tensor density = at::empty({x.size(0)}, at::kFloat);
  const float* const in = points.data_ptr<float>();
  const int64_t* const from = states.data_ptr<int64_t>();
  float* const out = density.data_ptr<float>();
  ParallelFor((x.size(0) + kTile - 1) / kTile, 8, [&](int64_t first, int64_t last) {
    TileMemory tile(field.rows().count);
    int32_t own[kTile];
    for (int64_t i = first; i < last; ++i) {
      const int64_t begin = i * kTile, count = std::min(kTile, x.size(0) - begin);
      for (int64_t s = 0; s < count; ++s) {
        for (int axis = 0; axis < 3; ++axis) tile.Row(field.rows().x + axis)[s] = in[3 * (begin + s) + axis];
        own[s] = static_cast<int32_t>(from[begin + s]);
      }
      field.Density(own, count, /*for_gradients=*/false, tile);
      std::copy_n(tile.Row(field.rows().density), count, out + begin);
    }
  });
  return density;
}

}  // namespace editnerf
