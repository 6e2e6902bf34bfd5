#include "libeditnerf/tracking/motion_flow.h"

#include "libeditnerf/base/shape.h"
#include "libeditnerf/tracking/gray_image.h"

namespace editnerf {
namespace {

constexpr int kSide = 7;  // pixels

cv::Mat GrayValues(const torch::Tensor& image) {
  cv::Mat values;
  GrayImage(image).convertTo(values, CV_32F);
  return values;
}

// Mean difference of gray values around each pixel, where the flow leads.
cv::Mat Unlikeness(const cv::Mat& from, const cv::Mat& to, const torch::Tensor& flow) {
  cv::Mat places(from.rows, from.cols, CV_32FC2), carried, difference, mean;
  const float* f = flow.data_ptr<float>();
  for (int row = 0; row < from.rows; ++row) {
    auto* place = places.ptr<cv::Vec2f>(row);
    for (int column = 0; column < from.cols; ++column, f += 2)
      place[column] = {static_cast<float>(column) + f[0], static_cast<float>(row) + f[1]};
  }
  cv::remap(to, carried, places, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  cv::absdiff(carried, from, difference);
  cv::blur(difference, mean, {kSide, kSide});
  return mean;
}

}  // namespace

torch::Tensor MostAlike(const torch::Tensor& from, const torch::Tensor& to, const std::vector<torch::Tensor>& guesses) {
  const int64_t height = from.size(0), width = from.size(1);
  const cv::Mat a = GrayValues(from), b = GrayValues(to);
  torch::Tensor best;
  cv::Mat least;
  for (const torch::Tensor& guess : guesses) {
    CheckShape(guess, {height, width, 2}, "guessed flow");
    const torch::Tensor flow = guess.contiguous();
    const cv::Mat cost = Unlikeness(a, b, flow);
    if (!best.defined()) {
      best = flow.clone(), least = cost;
      continue;
    }
    const float* other = flow.data_ptr<float>();
    float* out = best.data_ptr<float>();
    for (int64_t i = 0; i < height * width; ++i) {
      const auto row = static_cast<int>(i / width), column = static_cast<int>(i % width);
      if (!(cost.at<float>(row, column) < least.at<float>(row, column))) continue;
      least.at<float>(row, column) = cost.at<float>(row, column);
      out[2 * i] = other[2 * i], out[2 * i + 1] = other[2 * i + 1];
    }
  }
  return best;
}

FlowSequence CarryMotionOn(const torch::Tensor& images, const OpticalFlow& flow, const FlowSequence& sequence) {
  const int64_t pairs = sequence.forward.size(0);
  const torch::Tensor &forward = sequence.forward, &backward = sequence.backward;
  return ComputeFlowSequence(images, flow, [&](int64_t from, int64_t to) {
    std::vector<torch::Tensor> guesses;
    if (from < to) {
      guesses.push_back(forward[from]);
      if (from > 0) guesses.push_back(-backward[from - 1]);
      if (to < pairs) guesses.push_back(forward[to]);
    } else {
      guesses.push_back(backward[to]);
      if (from < pairs) guesses.push_back(-forward[from]);
      if (to > 0) guesses.push_back(backward[to - 1]);
    }
    return MostAlike(images[from], images[to], guesses);
  });
}

}  // namespace editnerf
