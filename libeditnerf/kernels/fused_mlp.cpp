#include "libeditnerf/kernels/fused_mlp.h"

#include <ATen/Functions.h>
#include <torch/csrc/autograd/function.h>
#include <torch/csrc/autograd/functions/utils.h>
#include <torch/csrc/autograd/saved_variable.h>

#include <algorithm>
#include <map>
#include <mutex>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/parallel.h"
#include "libeditnerf/base/shape.h"
#include "libeditnerf/kernels/dense_product.h"
#include "libeditnerf/kernels/kernel_use.h"

namespace editnerf {
namespace {

// Samples in a tile: a multiple of every block of rows in dense_product, and 64 of their activations fill half of a
// 48 KB cache.
constexpr int64_t kTile = 96;

struct Layer {
  int64_t in, out, padded_in, padded_out;
  std::vector<float> forward;   // [in, padded_out], transposed
  std::vector<float> backward;  // [out, padded_in]
  std::vector<float> bias;      // [padded_out]
  bool relu;
};

std::vector<Layer> PackLayers(const MlpLayers& layers) {
  std::vector<Layer> packed;
  for (size_t l = 0; l < layers.weights.size(); ++l) {
    const at::Tensor weight = layers.weights[l].detach().contiguous(), bias = layers.biases[l].detach().contiguous();
    Layer layer;
    layer.in = weight.size(1);
    layer.out = weight.size(0);
    layer.padded_in = PaddedWidth(layer.in);
    layer.padded_out = PaddedWidth(layer.out);
    layer.forward.assign(static_cast<size_t>(layer.in * layer.padded_out), 0);
    layer.backward.assign(static_cast<size_t>(layer.out * layer.padded_in), 0);
    layer.bias.assign(static_cast<size_t>(layer.padded_out), 0);
    const float* const w = weight.data_ptr<float>();
    for (int64_t o = 0; o < layer.out; ++o) {
      for (int64_t i = 0; i < layer.in; ++i) {
        layer.forward[static_cast<size_t>(i * layer.padded_out + o)] = w[o * layer.in + i];
        layer.backward[static_cast<size_t>(o * layer.padded_in + i)] = w[o * layer.in + i];
      }
    }
    std::copy_n(bias.data_ptr<float>(), layer.out, layer.bias.begin());
    layer.relu = l + 1 < layers.weights.size() || !layers.linear_output;
    packed.push_back(std::move(layer));
  }
  return packed;
}

struct Block {
  float* data;  // [S, width]
  int64_t width;
};

std::vector<Block> BlocksOf(const std::vector<at::Tensor>& tensors) {
  std::vector<Block> blocks;
  for (const at::Tensor& tensor : tensors) {
    blocks.push_back(tensor.defined() ? Block{tensor.data_ptr<float>(), tensor.size(1)} : Block{nullptr, 0});
  }
  return blocks;
}

// One tile's activations and gradients; each thread has its own.
class Tile {
 public:
  explicit Tile(const std::vector<Layer>& layers) : layers_(layers) {
    input_.resize(static_cast<size_t>(kTile * layers.front().in));
    int64_t widest = layers.front().padded_in;
    for (const Layer& layer : layers) {
      activations_.emplace_back(static_cast<size_t>(kTile * layer.padded_out));
      widest = std::max(widest, layer.padded_out);
    }
    gradient_.resize(static_cast<size_t>(kTile * widest));
    next_gradient_.resize(gradient_.size());
  }

  void Forward(const std::vector<Block>& inputs, int64_t first, int64_t rows) {
    Gather(inputs, first, rows);
    for (size_t l = 0; l < layers_.size(); ++l) {
      const Layer& layer = layers_[l];
      DenseProduct p;
      p.rows = rows, p.inner = layer.in, p.columns = layer.padded_out;
      p.a = Before(l), p.a_row = RowBefore(l);
      p.b = layer.forward.data(), p.b_row = layer.padded_out;
      p.c = activations_[l].data(), p.c_row = layer.padded_out;
      p.bias = layer.bias.data();
      MultiplyDense(p, layer.relu ? DenseResult::kBiasRelu : DenseResult::kBias);
    }
  }

  void StoreOutput(float* out, int64_t first, int64_t rows) const {
    const Layer& last = layers_.back();
    for (int64_t r = 0; r < rows; ++r) {
      std::copy_n(activations_.back().data() + r * last.padded_out, last.out, out + (first + r) * last.out);
    }
  }

  // After Forward. weight_sums: [in, padded_out] of every layer, bias_sums: [padded_out]; both are added to.
  void Backward(const float* grad_out, int64_t first, int64_t rows, std::vector<std::vector<float>>& weight_sums,
                std::vector<std::vector<float>>& bias_sums, const std::vector<Block>& grad_inputs) {
    LoadGradient(grad_out, first, rows);
    for (size_t l = layers_.size(); l-- > 0;) {
      const Layer& layer = layers_[l];
      for (int64_t r = 0; r < rows; ++r) {
        const float* const row = gradient_.data() + r * layer.padded_out;
        for (int64_t o = 0; o < layer.padded_out; ++o) bias_sums[l][static_cast<size_t>(o)] += row[o];
      }
      DenseProduct weights;
      weights.rows = layer.in, weights.inner = rows, weights.columns = layer.padded_out;
      weights.a = Before(l), weights.a_row = 1, weights.a_inner = RowBefore(l);
      weights.b = gradient_.data(), weights.b_row = layer.padded_out;
      weights.c = weight_sums[l].data(), weights.c_row = layer.padded_out;
      MultiplyDense(weights, DenseResult::kAdd);
      if (l == 0 && grad_inputs.empty()) return;
      DenseProduct data;
      data.rows = rows, data.inner = layer.out, data.columns = layer.padded_in;
      data.a = gradient_.data(), data.a_row = layer.padded_out;
      data.b = layer.backward.data(), data.b_row = layer.padded_in;
      data.c = next_gradient_.data(), data.c_row = layer.padded_in;
      data.mask = Before(l), data.mask_row = RowBefore(l);
      MultiplyDense(data, l > 0 ? DenseResult::kMask : DenseResult::kStore);
      gradient_.swap(next_gradient_);
    }
    Scatter(grad_inputs, first, rows);
  }

 private:
  const float* Before(size_t l) const { return l == 0 ? input_.data() : activations_[l - 1].data(); }
  int64_t RowBefore(size_t l) const { return l == 0 ? layers_[0].in : layers_[l - 1].padded_out; }

  void Gather(const std::vector<Block>& inputs, int64_t first, int64_t rows) {
    int64_t column = 0;
    for (const Block& block : inputs) {
      for (int64_t r = 0; r < rows; ++r) {
        std::copy_n(block.data + (first + r) * block.width, block.width,
                    input_.data() + r * layers_.front().in + column);
      }
      column += block.width;
    }
  }

  void LoadGradient(const float* grad_out, int64_t first, int64_t rows) {
    const Layer& last = layers_.back();
    for (int64_t r = 0; r < rows; ++r) {
      float* const row = gradient_.data() + r * last.padded_out;
      std::copy_n(grad_out + (first + r) * last.out, last.out, row);
      std::fill(row + last.out, row + last.padded_out, 0.0F);
      if (!last.relu) continue;
      const float* const value = activations_.back().data() + r * last.padded_out;
      for (int64_t o = 0; o < last.out; ++o) row[o] = value[o] > 0 ? row[o] : 0.0F;
    }
  }

  void Scatter(const std::vector<Block>& grad_inputs, int64_t first, int64_t rows) const {
    int64_t column = 0;
    for (const Block& block : grad_inputs) {
      if (block.data != nullptr) {
        for (int64_t r = 0; r < rows; ++r) {
          std::copy_n(gradient_.data() + r * layers_.front().padded_in + column, block.width,
                      block.data + (first + r) * block.width);
        }
      }
      column += block.width;
    }
  }

  const std::vector<Layer>& layers_;
  std::vector<float> input_;                     // [kTile, in]
  std::vector<std::vector<float>> activations_;  // [kTile, padded_out] of every layer
  std::vector<float> gradient_, next_gradient_;  // [kTile, padded_out] of the layer at hand
};

// body(begin, end) on ranges of whole tiles that cover `count` samples.
template <class Body>
void ForTiles(int64_t count, const Body& body) {
  ParallelFor((count + kTile - 1) / kTile, 8,
              [&](int64_t begin, int64_t end) { body(begin * kTile, std::min(count, end * kTile)); });
}

MlpLayers LayersFrom(const std::vector<at::Tensor>& tensors, size_t first, bool linear_output) {
  MlpLayers layers;
  const size_t depth = (tensors.size() - first) / 2;
  layers.weights.assign(tensors.begin() + static_cast<int64_t>(first),
                        tensors.begin() + static_cast<int64_t>(first + depth));
  layers.biases.assign(tensors.begin() + static_cast<int64_t>(first + depth), tensors.end());
  layers.linear_output = linear_output;
  return layers;
}

// Gradient sums of all layers: weights [in, padded_out], biases [padded_out].
struct LayerSums {
  std::vector<std::vector<float>> weights, biases;

  explicit LayerSums(const std::vector<Layer>& layers) {
    for (const Layer& layer : layers) {
      weights.emplace_back(static_cast<size_t>(layer.in * layer.padded_out), 0.0F);
      biases.emplace_back(static_cast<size_t>(layer.padded_out), 0.0F);
    }
  }

  void Add(const LayerSums& other) {
    for (size_t l = 0; l < weights.size(); ++l) {
      for (size_t i = 0; i < weights[l].size(); ++i) weights[l][i] += other.weights[l][i];
      for (size_t i = 0; i < biases[l].size(); ++i) biases[l][i] += other.biases[l][i];
    }
  }
};

at::Tensor Evaluate(const std::vector<at::Tensor>& inputs, const std::vector<Layer>& layers) {
  const int64_t count = inputs.front().size(0);
  at::Tensor out = at::empty({count, layers.back().out}, inputs.front().options().requires_grad(false));
  const std::vector<Block> blocks = BlocksOf(inputs);
  float* const values = out.data_ptr<float>();
  ForTiles(count, [&](int64_t begin, int64_t end) {
    Tile tile(layers);
    for (int64_t first = begin; first < end; first += kTile) {
      const int64_t rows = std::min(kTile, end - first);
      tile.Forward(blocks, first, rows);
      tile.StoreOutput(values, first, rows);
    }
  });
  return out;
}

// An autograd node by hand: torch::autograd::Function takes no list of tensors.
class FusedMlpNode : public torch::autograd::Node {
 public:
  FusedMlpNode(const std::vector<at::Tensor>& tensors, size_t num_inputs, bool linear_output)
      : num_inputs_(num_inputs), linear_output_(linear_output) {
    for (const at::Tensor& tensor : tensors) {
      add_next_edge(torch::autograd::impl::gradient_edge(tensor));
      saved_.emplace_back(tensor, /*is_output=*/false);
    }
  }

  torch::autograd::variable_list apply(torch::autograd::variable_list&& grads) override {
    const at::NoGradGuard no_grad;
    std::vector<at::Tensor> tensors;
    for (const auto& saved : saved_) tensors.push_back(saved.unpack().contiguous());
    const std::vector<at::Tensor> inputs(tensors.begin(), tensors.begin() + static_cast<int64_t>(num_inputs_));
    if (!grads[0].defined()) return torch::autograd::variable_list(tensors.size());
    const std::vector<Layer> layers = PackLayers(LayersFrom(tensors, num_inputs_, linear_output_));
    const at::Tensor grad_out = grads[0].contiguous();

    torch::autograd::variable_list results(num_inputs_);
    std::vector<Block> blocks;
    for (size_t i = 0; i < num_inputs_; ++i) {
      if (task_should_compute_output(i)) results[i] = at::empty_like(inputs[i]);
    }
    if (std::any_of(results.begin(), results.end(), [](const at::Tensor& t) { return t.defined(); })) {
      blocks = BlocksOf(results);
      for (size_t i = 0; i < num_inputs_; ++i) blocks[i].width = inputs[i].size(1);
    }
    const LayerSums sums = Backward(inputs, layers, grad_out.data_ptr<float>(), blocks);
    for (size_t l = 0; l < layers.size(); ++l) {
      const at::Tensor weights = at::empty({layers[l].out, layers[l].in}, grad_out.options());
      float* const w = weights.data_ptr<float>();
      for (int64_t o = 0; o < layers[l].out; ++o) {
        for (int64_t i = 0; i < layers[l].in; ++i) {
          w[o * layers[l].in + i] = sums.weights[l][static_cast<size_t>(i * layers[l].padded_out + o)];
        }
      }
      results.push_back(weights);
    }
    for (size_t l = 0; l < layers.size(); ++l) {
      const at::Tensor biases = at::empty({layers[l].out}, grad_out.options());
      std::copy_n(sums.biases[l].data(), layers[l].out, biases.data_ptr<float>());
      results.push_back(biases);
    }
    return results;
  }

  void release_variables() override { saved_.clear(); }

 private:
  static LayerSums Backward(const std::vector<at::Tensor>& inputs, const std::vector<Layer>& layers,
                            const float* grad_out, const std::vector<Block>& grad_inputs) {
    const std::vector<Block> blocks = BlocksOf(inputs);
    // Of every range by its beginning: added up in the order of the samples, not in that in which threads are done, so
    // that the same threads give the same bits.
    std::map<int64_t, LayerSums> parts;
    std::mutex mutex;
    ForTiles(inputs.front().size(0), [&](int64_t begin, int64_t end) {
      Tile tile(layers);
      LayerSums own(layers);
      for (int64_t first = begin; first < end; first += kTile) {
        const int64_t rows = std::min(kTile, end - first);
        tile.Forward(blocks, first, rows);
        tile.Backward(grad_out, first, rows, own.weights, own.biases, grad_inputs);
      }
      const std::lock_guard<std::mutex> lock(mutex);
      parts.emplace(begin, std::move(own));
    });
    LayerSums sums(layers);
    for (const auto& part : parts) sums.Add(part.second);
    return sums;
  }

  size_t num_inputs_;
  bool linear_output_;
  std::vector<torch::autograd::SavedVariable> saved_;  // the inputs, the weights, the biases
};

void Check(const std::vector<at::Tensor>& inputs, const MlpLayers& layers) {
  if (inputs.empty() || layers.weights.empty() || layers.weights.size() != layers.biases.size()) {
    Throw<ShapeError>("mlp: expected inputs, and a bias for every weight");
  }
  int64_t width = 0;
  for (const at::Tensor& input : inputs) {
    CheckShape(input, {inputs.front().size(0), kAny}, "mlp input");
    width += input.size(1);
  }
  for (size_t l = 0; l < layers.weights.size(); ++l) {
    CheckShape(layers.weights[l], {kAny, width}, "mlp weight");
    width = layers.weights[l].size(0);
    CheckShape(layers.biases[l], {width}, "mlp bias");
  }
}

}  // namespace

bool CanFuseMlp(const std::vector<at::Tensor>& inputs, const MlpLayers& layers) {
  const auto fits = [](const at::Tensor& t) { return KernelsTake(t); };
  const auto flat = [&](const at::Tensor& t) { return fits(t) && t.dim() == 2; };
  return std::all_of(inputs.begin(), inputs.end(), flat) &&
         std::all_of(layers.weights.begin(), layers.weights.end(), fits) &&
         std::all_of(layers.biases.begin(), layers.biases.end(), fits);
}

at::Tensor FusedMlp(const std::vector<at::Tensor>& inputs, const MlpLayers& layers) {
  Check(inputs, layers);
  std::vector<at::Tensor> tensors = inputs;
  tensors.insert(tensors.end(), layers.weights.begin(), layers.weights.end());
  tensors.insert(tensors.end(), layers.biases.begin(), layers.biases.end());
  std::vector<at::Tensor> packed;
  for (const at::Tensor& tensor : tensors) packed.push_back(tensor.detach().contiguous());
  const std::vector<at::Tensor> rows(packed.begin(), packed.begin() + static_cast<int64_t>(inputs.size()));
  at::Tensor out = Evaluate(rows, PackLayers(LayersFrom(packed, inputs.size(), layers.linear_output)));
  const bool differentiable =
      at::GradMode::is_enabled() &&
      std::any_of(tensors.begin(), tensors.end(), [](const auto& t) { return t.requires_grad(); });
  if (!differentiable) return out;
  // Saved as they came: an inner node's output, not a copy that leads nowhere.
  const std::shared_ptr<FusedMlpNode> node(new FusedMlpNode(tensors, inputs.size(), layers.linear_output),
                                           torch::autograd::deleteNode);
  torch::autograd::set_history(out, node);
  return out;
}

at::Tensor MlpReference(const std::vector<at::Tensor>& inputs, const MlpLayers& layers) {
  Check(inputs, layers);
  at::Tensor h = inputs.size() == 1 ? inputs.front() : at::cat(inputs, 1);
  for (size_t l = 0; l < layers.weights.size(); ++l) {
    h = at::linear(h, layers.weights[l], layers.biases[l]);
    if (l + 1 < layers.weights.size() || !layers.linear_output) h = at::relu(h);
  }
  return h;
}

}  // namespace editnerf
