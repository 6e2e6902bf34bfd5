// Small COLMAP models with known cameras and points, written as text or as binary files.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "libeditnerf/geometry/camera.h"
#include "tests/imaging/scratch_folder.h"

namespace editnerf {

struct ColmapFixture {
  std::vector<std::string> names;
  std::vector<Camera> cameras;  // one camera: the first's intrinsics are everybody's
  std::vector<Vec3> points;     // every frame observes every point; its error is 0.5 px
};

// Frames on an arc around the points, which fill the box [-1, 1]^3 + (2, 0, 5); file names 000000.png, ...
inline ColmapFixture ArcFixture(int count, int64_t width = 40, int64_t height = 30) {
  ColmapFixture fixture;
  for (int i = 0; i < 40; ++i) {
    const auto unit = [i](int k) { return 2 * std::fmod(0.5 + 0.618 * i * (k + 1), 1.0) - 1; };
    fixture.points.push_back({2 + unit(0), unit(1), 5 + unit(2)});
  }
  for (int i = 0; i < count; ++i) {
    Camera camera;
    const double angle = 0.05 * (i - count / 2);
    camera.orientation = {{std::cos(angle), 0, std::sin(angle), 0, 1, 0, -std::sin(angle), 0, std::cos(angle)}};
    camera.position = Vec3{2, 0, 5} - camera.orientation.Transposed() * Vec3{0, 0, 4};
    camera.focal_length = 35.5;
    camera.principal_point = {20.25, 14.75};
    camera.radial_distortion = {0.01, 0, 0};
    camera.width = width;
    camera.height = height;
    fixture.cameras.push_back(camera);
    fixture.names.push_back("00000" + std::to_string(i) + ".png");
  }
  return fixture;
}

// camera_from_world as w x y z; only for rotations about y, as ArcFixture makes them.
inline std::vector<double> QuaternionAboutY(const Mat3& r) {
  const double half = 0.5 * std::atan2(r(0, 2), r(0, 0));
  return {std::cos(half), 0, std::sin(half), 0};
}

inline void WriteColmapText(const ColmapFixture& fixture, const std::filesystem::path& folder,
                            const std::string& camera_line = "1 SIMPLE_RADIAL 40 30 35.5 20.25 14.75 0.01") {
  WriteText(folder / "cameras.txt", "# Camera list\n" + camera_line + "\n");
  std::string images = "# Image list\n", points = "# 3D point list\n";
  for (size_t i = fixture.names.size(); i-- > 0;) {  // not in the order of names
    const Camera& camera = fixture.cameras[i];
    const Vec3 t = -(camera.orientation * camera.position);
    images += std::to_string(i + 1);
    for (const double q : QuaternionAboutY(camera.orientation)) images += fmt::format(" {:.17g}", q);
    images += fmt::format(" {:.17g} {:.17g} {:.17g} 1 {}\n", t.x, t.y, t.z, fixture.names[i]);
    for (size_t p = 0; p < fixture.points.size(); ++p) images += fmt::format("1.5 2.5 {} ", 10 + p);
    images += "3.5 4.5 -1\n";
  }
  for (size_t p = 0; p < fixture.points.size(); ++p) {
    const Vec3& x = fixture.points[p];
    points += fmt::format("{} {:.17g} {:.17g} {:.17g} 255 0 0 0.5 1 {}\n", 10 + p, x.x, x.y, x.z, p);
  }
  WriteText(folder / "images.txt", images);
  WriteText(folder / "points3D.txt", points);
}

inline void WriteColmapBinary(const ColmapFixture& fixture, const std::filesystem::path& folder) {
  std::string out;
  const auto put = [&out](auto value) {
    char bytes[sizeof(value)];
    std::memcpy(bytes, &value, sizeof(value));
    out.append(bytes, sizeof(value));
  };
  const auto finish = [&](const char* name) {
    WriteText(folder / name, out);
    out.clear();
  };
  put(uint64_t{1});
  put(uint32_t{1});
  put(int32_t{2});  // SIMPLE_RADIAL
  put(uint64_t{40});
  put(uint64_t{30});
  for (const double p : {35.5, 20.25, 14.75, 0.01}) put(p);
  finish("cameras.bin");
  put(uint64_t{fixture.names.size()});
  for (size_t i = fixture.names.size(); i-- > 0;) {
    const Camera& camera = fixture.cameras[i];
    const Vec3 t = -(camera.orientation * camera.position);
    put(static_cast<uint32_t>(i + 1));
    for (const double q : QuaternionAboutY(camera.orientation)) put(q);
    for (const double v : {t.x, t.y, t.z}) put(v);
    put(uint32_t{1});
    out += fixture.names[i] + '\0';
    put(uint64_t{fixture.points.size() + 1});
    for (size_t p = 0; p <= fixture.points.size(); ++p) {
      put(1.5);
      put(2.5);
      put(p < fixture.points.size() ? uint64_t{10 + p} : ~uint64_t{0});
    }
  }
  finish("images.bin");
  put(uint64_t{fixture.points.size()});
  for (size_t p = 0; p < fixture.points.size(); ++p) {
    put(uint64_t{10 + p});
    for (const double v : {fixture.points[p].x, fixture.points[p].y, fixture.points[p].z}) put(v);
    out += std::string(3, '\xff');
    put(0.5);
    put(uint64_t{1});
    put(uint64_t{0});
  }
  finish("points3D.bin");
}

}  // namespace editnerf
