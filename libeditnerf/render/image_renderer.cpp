#include "libeditnerf/render/image_renderer.h"

#include <torch/types.h>
#include <torch/utils.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "libeditnerf/base/parallel.h"

namespace editnerf {
namespace {

constexpr int64_t kRows = 16;  // of pixels, to a thread at a time

// Unit directions [H * W, 3] through the pixel centres.
torch::Tensor PixelDirections(const Camera& camera) {
  auto directions = torch::empty({camera.height * camera.width, 3}, torch::kFloat64);
  double* const out = directions.data_ptr<double>();
  ParallelFor(camera.height, kRows, [&](int64_t begin, int64_t end) {
    for (int64_t row = begin; row < end; ++row) {
      for (int64_t column = 0; column < camera.width; ++column) {
        const Vec3 d = camera.DirectionThrough(static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5);
        double* const pixel = out + 3 * (row * camera.width + column);
        pixel[0] = d.x;
        pixel[1] = d.y;
        pixel[2] = d.z;
      }
    }
  });
  return directions;
}

// Rays of a coarse lattice of pixels go first and look everywhere. Those between begin shortly before the nearest thing
// that any of their neighbours met, and where they find themselves inside something already, they look again,
// everywhere. So empty space is evaluated for one ray in sixteen, and only what is narrower than four pixels and
// touches no ray of the lattice is missed before something else; a march step is as long as three pixels are wide at
// 320 x 180.
constexpr int64_t kLattice[] = {4, 2, 1};
// Of a ray's light, the share that may take its colour from the rest of it.
constexpr double kColorError = 1.0 / 256;

// Pixels [P] int64 of each lattice that no coarser one has.
std::vector<torch::Tensor> LatticePixels(const Camera& camera) {
  std::vector<torch::Tensor> levels;
  int64_t coarser = 0;
  for (const int64_t spacing : kLattice) {
    std::vector<int64_t> pixels;
    for (int64_t row = 0; row < camera.height; row += spacing) {
      for (int64_t column = 0; column < camera.width; column += spacing) {
        if (coarser > 0 && row % coarser == 0 && column % coarser == 0) continue;
        pixels.push_back(row * camera.width + column);
      }
    }
    levels.push_back(torch::tensor(pixels, torch::kInt64));
    coarser = spacing;
  }
  return levels;
}

// The least of front [H, W] within `radius` pixels of each.
torch::Tensor NearestAround(const torch::Tensor& front, int64_t radius) {
  const int64_t height = front.size(0), width = front.size(1);
  torch::Tensor rows = torch::empty_like(front), nearest = torch::empty_like(front);
  const float* const from = front.data_ptr<float>();
  float *const along = rows.data_ptr<float>(), *const to = nearest.data_ptr<float>();
  ParallelFor(height, kRows, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin * width; i < end * width; ++i) {
      const int64_t x = i % width, first = std::max<int64_t>(x - radius, 0), last = std::min(x + radius, width - 1);
      along[i] = *std::min_element(from + i - x + first, from + i - x + last + 1);
    }
  });
  ParallelFor(height, kRows, [&](int64_t begin, int64_t end) {
    for (int64_t y = begin; y < end; ++y) {
      float* const out = to + y * width;
      std::copy_n(along + y * width, width, out);
      for (int64_t other = std::max<int64_t>(y - radius, 0); other <= std::min(y + radius, height - 1); ++other) {
        for (int64_t x = 0; x < width; ++x) out[x] = std::min(out[x], along[other * width + x]);
      }
    }
  });
  return nearest;
}

struct Piece {
  torch::Tensor pixels;  // [P]
  RayResult result;
};

// to[pixels[i]] = rows[i]
void CopyRows(const torch::Tensor& rows, const torch::Tensor& pixels, torch::Tensor& to) {
  if (!rows.is_cpu() || !rows.is_contiguous()) {
    to.index_copy_(0, pixels, rows);
    return;
  }
  const auto bytes = static_cast<int64_t>(rows.element_size()) * (rows.dim() > 1 ? rows.size(1) : 1);
  const auto* const from = static_cast<const char*>(rows.data_ptr());
  auto* const out = static_cast<char*>(to.data_ptr());
  const int64_t* const pixel = pixels.data_ptr<int64_t>();
  ParallelFor(pixels.size(0), 4096, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      std::memcpy(out + pixel[i] * bytes, from + i * bytes, static_cast<size_t>(bytes));
    }
  });
}

torch::Tensor Joined(const std::vector<Piece>& pieces, torch::Tensor RayResult::*member, const Camera& camera) {
  torch::Tensor joined;
  for (const Piece& piece : pieces) {
    const torch::Tensor& part = piece.result.*member;
    if (!part.defined()) return {};
    if (!joined.defined()) {
      std::vector<int64_t> shape = part.sizes().vec();
      shape[0] = camera.height * camera.width;
      joined = torch::empty(shape, part.options());
    }
    CopyRows(part, piece.pixels, joined);
  }
  return joined.dim() == 1 ? joined.view({camera.height, camera.width})
                           : joined.view({camera.height, camera.width, joined.size(1)});
}

// Renders pixels of one picture, piece by piece.
class PictureRenderer {
 public:
  PictureRenderer(RadianceField& field, RayRenderer& renderer, const Camera& camera, const FrameStates& states,
                  const ImageOptions& options)
      : field_(field), renderer_(renderer), states_(states), options_(options) {
    const Vec3& position = camera.position;
    origin_ = torch::tensor({position.x, position.y, position.z}, torch::kFloat64).to(options.tensor);
    directions_ = PixelDirections(camera).to(options.tensor);
    fused_ = renderer.Fuses(field, {origin_, directions_, {}}, states);
  }

  bool fused() const { return fused_; }

  // start [P] or undefined, as RayOptions has it. Returns the index of the first new piece.
  size_t Render(const torch::Tensor& pixels, const torch::Tensor& start) {
    const int64_t count = pixels.size(0), chunk = fused_ ? kFusedChunk : options_.chunk;
    const size_t before = pieces_.size();
    pieces_.resize(before + static_cast<size_t>((count + chunk - 1) / chunk));
    const auto render = [&](int64_t index) {
      if (InterruptRequested()) Throw<Interrupted>("rendering stopped by request");
      const torch::NoGradGuard no_grad_here;  // each thread has its own
      const auto part = [&](const torch::Tensor& all) {
        return all.defined() ? all.narrow(0, index * chunk, std::min(chunk, count - index * chunk)) : all;
      };
      pieces_[before + static_cast<size_t>(index)] = RenderPiece(part(pixels), part(start));
    };
    const auto pieces = static_cast<int64_t>(pieces_.size() - before);
    if (!fused_) {
      ParallelParts(pieces, render);
    } else {
      for (int64_t index = 0; index < pieces; ++index) render(index);  // the kernels share rays out themselves
    }
    return before;
  }

  const std::vector<Piece>& pieces() const { return pieces_; }

 private:
  static constexpr int64_t kFusedChunk = 65536;  // rays between looks at Ctrl-C

  Piece RenderPiece(const torch::Tensor& pixels, const torch::Tensor& start) const {
    RayOptions options;
    options.background = options_.background;
    options.depth_only = options_.depth_only;
    options.march_steps = options_.march_steps;
    options.start = start;
    options.color_error = options_.exact ? 0 : kColorError;
    RayBatch rays;
    rays.direction = directions_.index_select(0, pixels.to(directions_.device()));
    rays.origin = origin_.expand_as(rays.direction);
    rays.state = torch::zeros({pixels.size(0)}, directions_.options().dtype(torch::kInt64));
    return {pixels.to(directions_.device()), renderer_.Render(field_, rays, states_, options)};
  }

  RadianceField& field_;
  RayRenderer& renderer_;
  const FrameStates& states_;
  const ImageOptions& options_;
  torch::Tensor origin_, directions_;  // [3], [H * W, 3]
  bool fused_ = false;
  std::vector<Piece> pieces_;
};

// Lattice by lattice.
void RenderFromNeighbours(const Camera& camera, PictureRenderer* picture) {
  torch::Tensor front = torch::full({camera.height, camera.width}, std::numeric_limits<float>::infinity());
  // Returns the pixels that have to be looked at again.
  const auto render = [&](const torch::Tensor& pixels, const torch::Tensor& start) {
    std::vector<torch::Tensor> again;
    for (size_t i = picture->Render(pixels, start); i < picture->pieces().size(); ++i) {
      const Piece& piece = picture->pieces()[i];
      front.view({-1}).index_copy_(0, piece.pixels, piece.result.front);
      again.push_back(piece.pixels.masked_select(piece.result.front < 0));
    }
    return torch::cat(again);
  };
  const std::vector<torch::Tensor> levels = LatticePixels(camera);
  for (size_t level = 0; level < levels.size(); ++level) {
    const torch::Tensor& pixels = levels[level];
    if (pixels.size(0) == 0) continue;
    torch::Tensor start;
    if (level > 0) start = NearestAround(front, kLattice[level]).view({-1}).index_select(0, pixels);
    const torch::Tensor again = render(pixels, start);
    if (again.size(0) > 0) render(again, {});
  }
}

}  // namespace

RenderedImage RenderImage(RadianceField& field, RayRenderer& renderer, const Camera& camera, const FrameStates& states,
                          const ImageOptions& options) {
  camera.Check("image camera");
  if (options.chunk < 1) Throw<ConfigError>("image chunk {}: expected at least one ray", options.chunk);
  torch::NoGradGuard no_grad;
  PictureRenderer picture(field, renderer, camera, states, options);
  if (options.exact || !picture.fused()) {
    picture.Render(torch::arange(camera.height * camera.width, torch::kInt64), {});
  } else {
    RenderFromNeighbours(camera, &picture);
  }
  const std::vector<Piece>& pieces = picture.pieces();
  RenderedImage image;
  for (const Piece& piece : pieces) image.samples += piece.result.samples;
  image.rgb = Joined(pieces, &RayResult::rgb, camera);
  image.opacity = Joined(pieces, &RayResult::opacity, camera);
  image.depth = Joined(pieces, &RayResult::depth, camera);
  image.depth_valid = Joined(pieces, &RayResult::depth_valid, camera);
  image.x_canonical = Joined(pieces, &RayResult::x_canonical, camera);
  image.ambient = Joined(pieces, &RayResult::ambient, camera);
  image.weights = Joined(pieces, &RayResult::weights, camera);
  return image;
}

}  // namespace editnerf
