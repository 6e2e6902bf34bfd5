#include "libeditnerf/tracking/surface_volume.h"

#include "tests/catch.h"

using namespace editnerf;

namespace {

// A plane of points, z = 0, over the unit square: [frames, 32, 32, 3].
torch::Tensor PlanePoints(int64_t frames) {
  const torch::Tensor axis = (torch::arange(32, torch::kFloat32) + 0.5) / 32;
  const torch::Tensor x = axis.view({1, 1, -1}).expand({frames, 32, 32}),
                      y = axis.view({1, -1, 1}).expand({frames, 32, 32});
  return torch::stack({x, y, torch::zeros({frames, 32, 32})}, 3).contiguous();
}

}  // namespace

TEST_CASE("the variance over frames is that of the per-frame means, averaged over the ambient dimensions") {
  const torch::Tensor points = PlanePoints(4);
  // One dimension alternates between 0 and 2 (variance 1), the other stands still; noise within a frame cancels.
  torch::Tensor ambient = torch::zeros({4, 32, 32, 2});
  ambient.slice(0, 1, 4, 2).select(3, 0).fill_(2);
  ambient.select(3, 1).slice(2, 0, 32, 2).fill_(1);
  ambient.select(3, 1).slice(2, 1, 32, 2).fill_(-1);
  SurfaceVolumeOptions options;
  options.resolution = 22;  // 16 voxels along the plane and the margin: two by two pixels in each
  options.min_observations = 4;
  const SurfaceVolume volume = BuildSurfaceVolume(points, ambient, options);
  const torch::Tensor seen = volume.variance.masked_select(volume.observations == 4);
  REQUIRE(seen.numel() > 100);
  CHECK(seen.min().item<double>() == Approx(0.5).margin(0.01));
  CHECK(volume.smoothed.max().item<double>() == Approx(0.5).margin(0.01));
  CHECK(volume.LongestSide() == Approx(22 * volume.voxel_size));
}

TEST_CASE("voxels seen in too few frames and points that are not finite do not count") {
  torch::Tensor points = PlanePoints(6);
  torch::Tensor ambient = torch::zeros({6, 32, 32, 1});
  ambient.slice(0, 0, 6, 2).slice(2, 0, 16).fill_(1);
  points.slice(0, 0, 4).slice(2, 0, 16).fill_(NAN);  // the left half is seen in two frames only
  SurfaceVolumeOptions options;
  options.resolution = 24;
  options.min_observations = 3;
  const SurfaceVolume volume = BuildSurfaceVolume(points, ambient, options);
  CHECK(volume.variance.max().item<double>() == 0);
  CHECK(LocalMaxima(volume, 0.1, 0.3).empty());
  CHECK_THROWS_WITH(BuildSurfaceVolume(torch::full({2, 8, 8, 3}, NAN), torch::zeros({2, 8, 8, 1}), options),
                    HasText("no pixel of any frame has a surface") && HasText("pretrain for longer"));
}

TEST_CASE("the masked Gaussian keeps constants on a surface and damps single voxels") {
  torch::Tensor mask = torch::zeros({24, 24, 24});
  mask.select(2, 12).fill_(1);
  const torch::Tensor smooth = MaskedGaussian(torch::full({24, 24, 24}, 3.0f), mask, 2.0);
  CHECK(smooth[12][12][12].item<double>() == Approx(3));
  CHECK(smooth[0][0][12].item<double>() > 2);
  CHECK(smooth[12][12][5].item<double>() == 0);
  torch::Tensor single = torch::zeros({24, 24, 24});
  single[12][12][12] = 1;
  CHECK(MaskedGaussian(torch::full({24, 24, 24}, 3.0f), single, 2.0).max().item<double>() < 1);
}

TEST_CASE("maxima are ranked, kept apart and cut off below the threshold") {
  const torch::Tensor points = PlanePoints(4);
  torch::Tensor ambient = torch::zeros({4, 32, 32, 1});
  const auto bump = [&](int64_t row, int64_t column, float height) {
    ambient.slice(0, 1, 4, 2).slice(1, row - 2, row + 3).slice(2, column - 2, column + 3).fill_(height);
  };
  bump(6, 6, 2);       // variance 1
  bump(6, 24, 3);      // 2.25
  bump(24, 15, 0.8f);  // 0.16, below a third of the strongest
  SurfaceVolumeOptions options;
  options.resolution = 38;
  options.min_observations = 2;
  options.smoothing = 1;
  const SurfaceVolume volume = BuildSurfaceVolume(points, ambient, options);
  const auto maxima = LocalMaxima(volume, 0.15, 0.3);
  REQUIRE(maxima.size() == 2);
  CHECK(Norm(maxima[0].point - Vec3{24.5 / 32, 6.5 / 32, 0}) < 0.05);
  CHECK(Norm(maxima[1].point - Vec3{6.5 / 32, 6.5 / 32, 0}) < 0.05);
  CHECK(maxima[0].value > maxima[1].value);
  CHECK(LocalMaxima(volume, 0.15, 0.01).size() == 3);
  CHECK(LocalMaxima(volume, 0.9, 0.01).size() == 1);
}
