#include <torch/types.h>

#include <cmath>
#include <memory>

#include "libeditnerf/base/parallel.h"
#include "libeditnerf/benchmarks/kernel_cases.h"
#include "libeditnerf/kernels/bf16_table.h"
#include "libeditnerf/kernels/hash_encoding.h"
#include "libeditnerf/kernels/tile.h"
#include "libeditnerf/kernels/tile_mlp.h"

namespace editnerf {
namespace {

// A network of the field over one tile, again and again: what is in the caches of a training step.
struct NetworkTile {
  MlpLayers layers;
  TileMlp mlp;
  TileMemory input, activations, grad, to_input, scratch;
  TileMlpSums sums;

  NetworkTile(const MlpLayers& shared, Bf16Unit unit)
      : layers(shared),
        mlp(shared, unit),
        input(mlp.in()),
        activations(mlp.activation_rows()),
        grad(mlp.out()),
        to_input(mlp.in()),
        scratch(mlp.scratch_rows()),
        sums(mlp.MakeSums()) {
    for (TileMemory* const rows : {&input, &grad}) {
      const int64_t count = rows == &input ? mlp.in() : mlp.out();
      for (int64_t i = 0; i < count * kTileStride; ++i) rows->rows()[i] = static_cast<float>(std::sin(i));
    }
  }
  void Forward() { mlp.Forward(input.rows(), kTile, activations.rows()); }
  void BothWays() {
    Forward();
    const InputGradient all = {0, mlp.in(), to_input.rows()};
    mlp.Backward(input.rows(), activations.rows(), grad.rows(), kTile, scratch.rows(), sums, all);
  }
};

// Tiles of every thread.
template <class Call>
std::function<void()> OnTiles(const MlpLayers& layers, Bf16Unit unit, int64_t tiles, const Call& call) {
  const auto owned = std::make_shared<std::vector<std::unique_ptr<NetworkTile>>>();
  const int64_t most = NumThreads();
  for (int64_t t = 0; t < most; ++t) owned->push_back(std::make_unique<NetworkTile>(layers, unit));
  return [=] {
    ParallelFor(most, 1, [&](int64_t begin, int64_t end) {
      for (int64_t t = begin; t < end; ++t) {
        for (int64_t i = t; i < tiles; i += most) call(*(*owned)[static_cast<size_t>(t)]);
      }
    });
  };
}

void AddNetwork(const Config& config, Bf16Unit unit, int64_t samples, std::vector<KernelCase>* cases) {
  const int64_t width = config.field.fast.width;
  const std::vector<int64_t> widths = {config.field.fast.geometry_features + 16, width, width, 3};
  MlpLayers layers;
  for (size_t l = 0; l + 1 < widths.size(); ++l) {
    layers.weights.push_back(torch::rand({widths[l + 1], widths[l]}) - 0.5);
    layers.biases.push_back(torch::zeros({widths[l + 1]}));
  }
  const int64_t tiles = samples / kTile;
  const auto count = static_cast<double>(tiles * kTile);
  const double operations = NetworkOperations(widths), peak = MeasureBf16Peak(unit);
  const std::string name = NameOf(unit);
  const auto forward = [](NetworkTile& tile) { tile.Forward(); };
  const auto both_ways = [](NetworkTile& tile) { tile.BothWays(); };
  cases->push_back({"tiles of a network, " + name, count, operations, OnTiles(layers, unit, tiles, forward),
                    OnTiles(layers, Bf16Unit::kNone, tiles, forward), peak});
  cases->push_back({"tiles of a network, both ways, " + name, count, 3 * operations,
                    OnTiles(layers, unit, tiles, both_ways), OnTiles(layers, Bf16Unit::kNone, tiles, both_ways), peak});
}

// A copy of a table in bfloat16 against the table itself, level by level and tile by tile, as the fused pass goes.
void AddEncoding(const Config& config, int64_t samples, std::vector<KernelCase>* cases) {
  const HashEncodingConfig& hash = config.field.fast.canonical_hash;
  const auto resolutions = HashResolutions(hash.num_levels, hash.base_resolution, hash.finest_resolution);
  const int64_t size = int64_t{1} << hash.log2_table_size, tiles = samples / kHashTile;
  const auto table = torch::rand({hash.num_levels, size, 2}), x = torch::rand({tiles, 3, kHashTile});
  const auto copy = std::make_shared<Bf16Table>();
  copy->Refresh(table);
  const auto over_tiles = [=](const auto& encode) {
    return [=] {
      ParallelFor(tiles, 4, [&](int64_t begin, int64_t end) {
        alignas(64) float out[2][kHashTile];
        for (int64_t i = begin; i < end; ++i) {
          const float* const at = x.data_ptr<float>() + i * 3 * kHashTile;
          const HashPoints points = {kHashTile, {at, at + kHashTile, at + 2 * kHashTile}};
          for (int64_t level = 0; level < hash.num_levels; ++level) {
            encode(points, HashLevel{resolutions[static_cast<size_t>(level)], size}, level, out[0], out[1]);
          }
        }
      });
    };
  };
  const auto from_copy = [copy](const HashPoints& points, const HashLevel& where, int64_t level, float* a, float* b) {
    EncodeBf16HashLevel(points, where, copy->Level(level), a, b);
  };
  const auto from_table = [=](const HashPoints& points, const HashLevel& where, int64_t level, float* a, float* b) {
    EncodeHashLevel(points, where, table.data_ptr<float>() + 2 * level * size, a, b);
  };
  cases->push_back({"hash encoding from bfloat16", static_cast<double>(tiles * kHashTile),
                    EncodingOperations(hash.num_levels), over_tiles(from_copy), over_tiles(from_table)});
}

}  // namespace

std::vector<KernelCase> Bf16KernelCases(const Config& config, int64_t samples) {
  std::vector<KernelCase> cases;
  for (const Bf16Unit unit : Bf16UnitsHere()) AddNetwork(config, unit, samples, &cases);
  AddEncoding(config, samples, &cases);
  return cases;
}

}  // namespace editnerf
