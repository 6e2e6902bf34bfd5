#include "libeditnerf/geometry/camera_tensors.h"

#include "libeditnerf/base/error.h"

namespace editnerf {
namespace {

torch::Tensor Stack(const std::vector<double>& values, at::IntArrayRef shape) {
  return torch::tensor(values, torch::kFloat64).reshape(shape);
}

template <class Numbers>
void Append(std::vector<double>& values, const Numbers& numbers) {
  values.insert(values.end(), numbers.begin(), numbers.end());
}

}  // namespace

CameraTensors CameraTensors::To(torch::Dtype dtype, torch::Device device) const {
  CameraTensors moved = *this;
  for (torch::Tensor* tensor : {&moved.orientation, &moved.position, &moved.focal_length, &moved.aspect, &moved.skew,
                                &moved.principal_point, &moved.radial, &moved.tangential}) {
    *tensor = tensor->to(device, dtype);
  }
  return moved;
}

CameraTensors StackCameras(const std::vector<Camera>& cameras, torch::Dtype dtype, torch::Device device) {
  if (cameras.empty()) Throw<DataError>("cameras: expected at least one, found none");
  const int64_t count = static_cast<int64_t>(cameras.size());
  CameraTensors stacked;
  stacked.width = cameras.front().width;
  stacked.height = cameras.front().height;
  std::vector<double> orientation, position, focal_length, aspect, skew, principal_point, radial, tangential;
  for (size_t i = 0; i < cameras.size(); ++i) {
    const Camera& camera = cameras[i];
    if (camera.width != stacked.width || camera.height != stacked.height) {
      Throw<DataError>("camera {}: expected images of {} x {} pixels like the first camera's, found {} x {}", i,
                       stacked.width, stacked.height, camera.width, camera.height);
    }
    Append(orientation, camera.orientation.m);
    Append(position, std::array<double, 3>{camera.position.x, camera.position.y, camera.position.z});
    focal_length.push_back(camera.focal_length);
    aspect.push_back(camera.pixel_aspect_ratio);
    skew.push_back(camera.skew);
    Append(principal_point, camera.principal_point);
    Append(radial, camera.radial_distortion);
    Append(tangential, camera.tangential_distortion);
    stacked.distorted = stacked.distorted || camera.HasDistortion();
  }
  stacked.orientation = Stack(orientation, {count, 3, 3});
  stacked.position = Stack(position, {count, 3});
  stacked.focal_length = Stack(focal_length, {count});
  stacked.aspect = Stack(aspect, {count});
  stacked.skew = Stack(skew, {count});
  stacked.principal_point = Stack(principal_point, {count, 2});
  stacked.radial = Stack(radial, {count, 3});
  stacked.tangential = Stack(tangential, {count, 2});
  return stacked.To(dtype, device);
}

}  // namespace editnerf
