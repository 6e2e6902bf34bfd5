#include <algorithm>
#include <mutex>
#include <opencv2/video/tracking.hpp>

#include "libeditnerf/tracking/gray_image.h"
#include "libeditnerf/tracking/optical_flow.h"

namespace editnerf {
namespace {

// OpenCV divides the patch search into as many stripes as it has threads, and the stripes' borders show in the flow.
// One thread makes the result the same on every machine; the callers compute several pairs at once instead.
class OneOpenCvThread {
 public:
  OneOpenCvThread() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (users_++ == 0) {
      before_ = cv::getNumThreads();
      cv::setNumThreads(1);
    }
  }
  ~OneOpenCvThread() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (--users_ == 0) cv::setNumThreads(before_);
  }
  OneOpenCvThread(const OneOpenCvThread&) = delete;
  OneOpenCvThread& operator=(const OneOpenCvThread&) = delete;

 private:
  static inline std::mutex mutex_;
  static inline int users_ = 0;
  static inline int before_ = 1;
};

}  // namespace

torch::Tensor DisFlow::Flow(const torch::Tensor& from, const torch::Tensor& to) const { return Search(from, to, {}); }

torch::Tensor DisFlow::FlowFrom(const torch::Tensor& from, const torch::Tensor& to, const torch::Tensor& guess) const {
  CheckGuess(from, guess);
  const torch::Tensor start = guess.to(torch::kFloat32).contiguous();
  return Search(from, to, start);
}

torch::Tensor DisFlow::Search(const torch::Tensor& from, const torch::Tensor& to, const torch::Tensor& guess) {
  CheckImages(from, to);
  const OneOpenCvThread guard;
  const cv::Ptr<cv::DISOpticalFlow> dis = cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM);
  dis->setFinestScale(0);
  cv::Mat flow;  // where it has a size, the search begins from it
  if (guess.defined()) {
    flow.create(static_cast<int>(from.size(0)), static_cast<int>(from.size(1)), CV_32FC2);
    std::copy_n(guess.data_ptr<float>(), guess.numel(), flow.ptr<float>());
  }
  dis->calc(GrayImage(from), GrayImage(to), flow);
  return torch::from_blob(flow.data, {from.size(0), from.size(1), 2}, torch::kFloat32).clone();
}

}  // namespace editnerf
