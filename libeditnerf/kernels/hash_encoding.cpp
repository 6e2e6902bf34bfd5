#include "libeditnerf/kernels/hash_encoding.h"

#include <torch/csrc/autograd/custom_function.h>
#include <torch/types.h>

#include <algorithm>
#include <cmath>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/kernels/hash_index.h"
#include "libeditnerf/kernels/hash_level.h"
#include "libeditnerf/kernels/kernel_use.h"

namespace editnerf {
namespace {

using hash_index::Level;

// Samples that one level is applied to before the next: their coordinates and outputs stay in the first-level cache,
// and a level's table in the second.
constexpr int64_t kTile = 512;
constexpr int64_t kMaxFeatures = 8;

// Float32 with two features per entry goes through hash_level.h, tile by tile; all else through the loops below it.
template <class T, int64_t kFeatures>
constexpr bool kHasLevelKernel = std::is_same_v<T, float>&& kFeatures == 2;

// Some samples in the layout of hash_level.h, coordinate by coordinate.
struct LevelTile {
  int64_t count;
  alignas(64) float x[3][kHashTile];
  alignas(64) float feature[2][kHashTile];  // or its gradient

  HashPoints Points() const { return {count, {x[0], x[1], x[2]}}; }
};

void LoadPoints(const float* x, int64_t first, int64_t count, LevelTile& tile) {
  tile.count = std::min(count - first, kHashTile);
  for (int64_t s = 0; s < kHashTile; ++s) {
    for (int axis = 0; axis < 3; ++axis) {
      const float value = s < tile.count ? x[3 * (first + s) + axis] : 0.0F;
      tile.x[axis][s] = value >= 0 ? std::min(value, 1.0F) : 0.0F;  // a NaN becomes 0
    }
  }
}

// rows[s * stride], rows[s * stride + 1]: the two features of sample s in one level.
void LoadFeatures(const float* rows, int64_t stride, LevelTile& tile) {
  for (int64_t s = 0; s < tile.count; ++s) {
    for (int f = 0; f < 2; ++f) tile.feature[f][s] = rows[s * stride + f];
  }
}

// body(tile, its first sample)
template <class Body>
void ForTiles(const float* x, int64_t count, const Body& body) {
  ParallelFor((count + kHashTile - 1) / kHashTile, 4, [&](int64_t first_tile, int64_t last_tile) {
    LevelTile tile;
    for (int64_t t = first_tile; t < last_tile; ++t) {
      LoadPoints(x, t * kHashTile, count, tile);
      body(tile, t * kHashTile);
    }
  });
}

void ForwardTiles(const float* x, const float* table, const std::vector<int64_t>& resolutions, int64_t count,
                  int64_t table_size, float* out) {
  const auto levels = static_cast<int64_t>(resolutions.size());
  ForTiles(x, count, [&](LevelTile& tile, int64_t first) {
    for (int64_t l = 0; l < levels; ++l) {
      EncodeHashLevel(tile.Points(), {resolutions[l], table_size}, table + 2 * l * table_size, tile.feature[0],
                      tile.feature[1]);
      for (int64_t s = 0; s < tile.count; ++s) {
        for (int f = 0; f < 2; ++f) out[2 * ((first + s) * levels + l) + f] = tile.feature[f][s];
      }
    }
  });
}

void BackwardTableTiles(const float* x, const float* grad_out, const std::vector<int64_t>& resolutions, int64_t count,
                        int64_t table_size, float* grad_table) {
  const auto levels = static_cast<int64_t>(resolutions.size());
  ParallelFor(levels, 1, [&](int64_t first_level, int64_t last_level) {
    LevelTile tile;
    for (int64_t first = 0; first < count; first += kHashTile) {
      LoadPoints(x, first, count, tile);
      for (int64_t l = first_level; l < last_level; ++l) {
        LoadFeatures(grad_out + 2 * (first * levels + l), 2 * levels, tile);
        ScatterHashLevel(tile.Points(), {resolutions[l], table_size}, tile.feature[0], tile.feature[1],
                         grad_table + 2 * l * table_size);
      }
    }
  });
}

void BackwardPositionTiles(const float* x, const float* table, const float* grad_out,
                           const std::vector<int64_t>& resolutions, int64_t count, int64_t table_size, float* grad_x) {
  const auto levels = static_cast<int64_t>(resolutions.size());
  ForTiles(x, count, [&](LevelTile& tile, int64_t first) {
    float slope[3][kHashTile] = {};
    float* const slopes[3] = {slope[0], slope[1], slope[2]};
    for (int64_t l = 0; l < levels; ++l) {
      LoadFeatures(grad_out + 2 * (first * levels + l), 2 * levels, tile);
      SlopeHashLevel(tile.Points(), {resolutions[l], table_size}, table + 2 * l * table_size, tile.feature[0],
                     tile.feature[1], slopes);
    }
    for (int64_t s = 0; s < tile.count; ++s) {
      for (int axis = 0; axis < 3; ++axis) {
        const float value = x[3 * (first + s) + axis];
        grad_x[3 * (first + s) + axis] = value >= 0 && value <= 1 ? slope[axis][s] : 0.0F;
      }
    }
  });
}

// The cell that holds a coordinate, and the position inside it.
template <class T>
struct Cell {
  uint32_t corner;
  T fraction;
  bool inside;  // whether the coordinate moves the result
};

template <class T>
Cell<T> Locate(T x, int64_t resolution) {
  const bool inside = x >= T(0) && x <= T(1);
  const T clamped = x >= T(0) ? std::min(x, T(1)) : T(0);  // a NaN becomes 0
  const T scaled = clamped * static_cast<T>(resolution);
  const int64_t corner = std::min(static_cast<int64_t>(scaled), resolution - 1);
  return {static_cast<uint32_t>(corner), scaled - static_cast<T>(corner), inside};
}

// Corner c takes the upper neighbour along axis a where bit a of c is set.
template <class T>
struct Corners {
  uint32_t entry[8];
  T weight[8];
};

template <class T>
Corners<T> Gather(const Level& level, const Cell<T> cell[3]) {
  Corners<T> corners;
  for (uint32_t jk = 0; jk < 4; ++jk) {
    const uint32_t dj = jk & 1, dk = jk >> 1;
    const uint32_t row = level.Row(cell[1].corner + dj, cell[2].corner + dk);
    const T weight = (dj ? cell[1].fraction : 1 - cell[1].fraction) * (dk ? cell[2].fraction : 1 - cell[2].fraction);
    corners.entry[2 * jk] = level.Entry(cell[0].corner, row);
    corners.entry[2 * jk + 1] = level.Entry(cell[0].corner + 1, row);
    corners.weight[2 * jk] = weight * (1 - cell[0].fraction);
    corners.weight[2 * jk + 1] = weight * cell[0].fraction;
  }
  return corners;
}

template <class T>
void Locate3(const T* x, int64_t resolution, Cell<T> cell[3]) {
  for (int axis = 0; axis < 3; ++axis) cell[axis] = Locate(x[axis], resolution);
}

template <class T, int64_t kFeatures>
void Forward(const T* x, const T* table, const std::vector<int64_t>& resolutions, int64_t count, int64_t table_size,
             T* out) {
  if constexpr (kHasLevelKernel<T, kFeatures>) return ForwardTiles(x, table, resolutions, count, table_size, out);
  const auto levels = static_cast<int64_t>(resolutions.size());
  const int64_t width = levels * kFeatures;
  ParallelFor((count + kTile - 1) / kTile, 1, [&](int64_t first_tile, int64_t last_tile) {
    for (int64_t tile = first_tile; tile < last_tile; ++tile) {
      const int64_t begin = tile * kTile, end = std::min(count, begin + kTile);
      for (int64_t l = 0; l < levels; ++l) {
        const Level level(resolutions[l], table_size);
        const T* features = table + l * table_size * kFeatures;
        for (int64_t s = begin; s < end; ++s) {
          Cell<T> cell[3];
          Locate3(x + 3 * s, resolutions[l], cell);
          const Corners<T> corners = Gather(level, cell);
          T sum[kFeatures] = {};
          for (int c = 0; c < 8; ++c)
            for (int64_t f = 0; f < kFeatures; ++f)
              sum[f] += corners.weight[c] * features[corners.entry[c] * kFeatures + f];
          for (int64_t f = 0; f < kFeatures; ++f) out[s * width + l * kFeatures + f] = sum[f];
        }
      }
    }
  });
}

// Levels are shared out among the threads, so no two threads add to the same entry.
template <class T, int64_t kFeatures>
void BackwardTable(const T* x, const T* grad_out, const std::vector<int64_t>& resolutions, int64_t count,
                   int64_t table_size, T* grad_table) {
  if constexpr (kHasLevelKernel<T, kFeatures>) {
    return BackwardTableTiles(x, grad_out, resolutions, count, table_size, grad_table);
  }
  const auto levels = static_cast<int64_t>(resolutions.size());
  const int64_t width = levels * kFeatures;
  ParallelFor(levels, 1, [&](int64_t first_level, int64_t last_level) {
    for (int64_t l = first_level; l < last_level; ++l) {
      const Level level(resolutions[l], table_size);
      T* features = grad_table + l * table_size * kFeatures;
      for (int64_t s = 0; s < count; ++s) {
        const T* grad = grad_out + s * width + l * kFeatures;
        Cell<T> cell[3];
        Locate3(x + 3 * s, resolutions[l], cell);
        const Corners<T> corners = Gather(level, cell);
        for (int c = 0; c < 8; ++c)
          for (int64_t f = 0; f < kFeatures; ++f)
            features[corners.entry[c] * kFeatures + f] += corners.weight[c] * grad[f];
      }
    }
  });
}

template <class T, int64_t kFeatures>
void BackwardPosition(const T* x, const T* table, const T* grad_out, const std::vector<int64_t>& resolutions,
                      int64_t count, int64_t table_size, T* grad_x) {
  if constexpr (kHasLevelKernel<T, kFeatures>) {
    return BackwardPositionTiles(x, table, grad_out, resolutions, count, table_size, grad_x);
  }
  const auto levels = static_cast<int64_t>(resolutions.size());
  const int64_t width = levels * kFeatures;
  ParallelFor((count + kTile - 1) / kTile, 1, [&](int64_t first_tile, int64_t last_tile) {
    for (int64_t tile = first_tile; tile < last_tile; ++tile) {
      const int64_t begin = tile * kTile, end = std::min(count, begin + kTile);
      for (int64_t l = 0; l < levels; ++l) {
        const Level level(resolutions[l], table_size);
        const T* features = table + l * table_size * kFeatures;
        for (int64_t s = begin; s < end; ++s) {
          Cell<T> cell[3];
          Locate3(x + 3 * s, resolutions[l], cell);
          const Corners<T> corners = Gather(level, cell);
          T value[8] = {};  // what each corner contributes to the loss
          for (int c = 0; c < 8; ++c)
            for (int64_t f = 0; f < kFeatures; ++f)
              value[c] += grad_out[s * width + l * kFeatures + f] * features[corners.entry[c] * kFeatures + f];
          for (int axis = 0; axis < 3; ++axis) {
            if (!cell[axis].inside) continue;
            const int a = (axis + 1) % 3, b = (axis + 2) % 3;
            T slope = 0;
            for (int c = 0; c < 8; ++c) {
              const T wa = c >> a & 1 ? cell[a].fraction : 1 - cell[a].fraction;
              const T wb = c >> b & 1 ? cell[b].fraction : 1 - cell[b].fraction;
              slope += (c >> axis & 1 ? wa * wb : -wa * wb) * value[c];
            }
            grad_x[3 * s + axis] += slope * static_cast<T>(resolutions[l]);
          }
        }
      }
    }
  });
}

template <class Body>
void DispatchFeatures(int64_t features, const Body& body) {
  switch (features) {
    case 1:
      return body(std::integral_constant<int64_t, 1>{});
    case 2:
      return body(std::integral_constant<int64_t, 2>{});
    case 4:
      return body(std::integral_constant<int64_t, 4>{});
    case 8:
      return body(std::integral_constant<int64_t, 8>{});
    default:
      Throw<ShapeError>("hash encoding: expected 1, 2, 4 or 8 features per level, found {}", features);
  }
}

class HashEncodeFunction : public torch::autograd::Function<HashEncodeFunction> {
 public:
  static at::Tensor forward(torch::autograd::AutogradContext* context, const at::Tensor& x, const at::Tensor& table,
                            const std::vector<int64_t>& resolutions) {
    const at::Tensor points = x.contiguous(), entries = table.contiguous();
    context->save_for_backward({points, entries});
    context->saved_data["resolutions"] = resolutions;
    at::Tensor out = at::empty({points.size(0), table.size(0) * table.size(2)}, points.options());
    AT_DISPATCH_FLOATING_TYPES(points.scalar_type(), "HashEncode", [&] {
      DispatchFeatures(entries.size(2), [&](auto features) {
        Forward<scalar_t, decltype(features)::value>(points.data_ptr<scalar_t>(), entries.data_ptr<scalar_t>(),
                                                     resolutions, points.size(0), entries.size(1),
                                                     out.data_ptr<scalar_t>());
      });
    });
    return out;
  }

  static torch::autograd::variable_list backward(torch::autograd::AutogradContext* context,
                                                 torch::autograd::variable_list grads) {
    const auto saved = context->get_saved_variables();
    const at::Tensor &x = saved[0], &table = saved[1];
    const std::vector<int64_t> resolutions = context->saved_data["resolutions"].toIntVector();
    const at::Tensor grad_out = grads[0].contiguous();
    at::Tensor grad_x, grad_table;
    if (context->needs_input_grad(0)) grad_x = at::zeros_like(x);
    if (context->needs_input_grad(1)) grad_table = at::zeros_like(table);
    AT_DISPATCH_FLOATING_TYPES(x.scalar_type(), "HashEncodeBackward", [&] {
      DispatchFeatures(table.size(2), [&](auto features) {
        constexpr int64_t kFeatures = decltype(features)::value;
        const scalar_t* grad = grad_out.data_ptr<scalar_t>();
        if (grad_table.defined()) {
          BackwardTable<scalar_t, kFeatures>(x.data_ptr<scalar_t>(), grad, resolutions, x.size(0), table.size(1),
                                             grad_table.data_ptr<scalar_t>());
        }
        if (grad_x.defined()) {
          BackwardPosition<scalar_t, kFeatures>(x.data_ptr<scalar_t>(), table.data_ptr<scalar_t>(), grad, resolutions,
                                                x.size(0), table.size(1), grad_x.data_ptr<scalar_t>());
        }
      });
    });
    return {grad_x, grad_table, at::Tensor()};
  }
};

void Check(const at::Tensor& x, const at::Tensor& table, const std::vector<int64_t>& resolutions) {
  CheckShape(x, {kAny, 3}, "hash encoding x");
  CheckShape(table, {static_cast<int64_t>(resolutions.size()), kAny, kAny}, "hash encoding table");
  const int64_t entries = table.size(1);
  if (entries < 1 || (entries & (entries - 1)) != 0) {
    Throw<ShapeError>("hash encoding table: expected a power of two of entries, found {}", entries);
  }
  if (table.size(2) > kMaxFeatures) {
    Throw<ShapeError>("hash encoding: expected 1, 2, 4 or 8 features per level, found {}", table.size(2));
  }
  if (x.scalar_type() != table.scalar_type() || !x.is_floating_point()) {
    Throw<ShapeError>("hash encoding: expected x and table of one floating type, found {} and {}",
                      c10::toString(x.scalar_type()), c10::toString(table.scalar_type()));
  }
}

}  // namespace

at::Tensor HashEncode(const at::Tensor& x, const at::Tensor& table, const std::vector<int64_t>& resolutions) {
  Check(x, table, resolutions);
  if (!x.device().is_cpu() || PlainOperations::Wanted()) return HashEncodeReference(x, table, resolutions);
  return HashEncodeFunction::apply(x, table, resolutions);
}

at::Tensor HashEncodeReference(const at::Tensor& x, const at::Tensor& table, const std::vector<int64_t>& resolutions) {
  Check(x, table, resolutions);
  const int64_t table_size = table.size(1);
  std::vector<at::Tensor> encoded;
  // where() rather than clamp(): its gradient is zero outside, and a NaN becomes 0.
  const at::Tensor inside = x.ge(0).logical_and(x.le(1));
  const at::Tensor position = at::where(inside, x, x.gt(1).to(x.scalar_type()));
  for (size_t l = 0; l < resolutions.size(); ++l) {
    const int64_t resolution = resolutions[l];
    const at::Tensor scaled = position * resolution;
    const at::Tensor corner = scaled.detach().floor().clamp_max(resolution - 1);
    const at::Tensor fraction = scaled - corner;
    const at::Tensor cell = corner.to(at::kLong);
    at::Tensor sum;
    for (int c = 0; c < 8; ++c) {
      const at::Tensor i = cell.select(1, 0) + (c & 1), j = cell.select(1, 1) + (c >> 1 & 1),
                       k = cell.select(1, 2) + (c >> 2 & 1);
      at::Tensor row;
      if (hash_index::IsDense(resolution, table_size)) {
        row = (resolution + 1) * (j + (resolution + 1) * k);
      } else {
        row = (j * int64_t{hash_index::kPrimeY}).bitwise_xor(k * int64_t{hash_index::kPrimeZ});
      }
      const at::Tensor entry = (i + row).bitwise_and(table_size - 1);
      at::Tensor weight = at::ones_like(x.select(1, 0));
      for (int axis = 0; axis < 3; ++axis) {
        const at::Tensor along = fraction.select(1, axis);
        weight = weight * (c >> axis & 1 ? along : 1 - along);
      }
      const at::Tensor term = weight.unsqueeze(1) * table[static_cast<int64_t>(l)].index_select(0, entry);
      sum = sum.defined() ? sum + term : term;
    }
    encoded.push_back(sum);
  }
  return at::cat(encoded, 1);
}

std::vector<int64_t> HashResolutions(int64_t levels, double base, double finest) {
  std::vector<int64_t> resolutions;
  for (int64_t l = 0; l < levels; ++l) {
    const double share = levels > 1 ? static_cast<double>(l) / static_cast<double>(levels - 1) : 0.0;
    resolutions.push_back(static_cast<int64_t>(std::floor(base * std::pow(finest / base, share) + 1e-9)));
  }
  return resolutions;
}

}  // namespace editnerf
