// Three doubles and a 3 x 3 matrix: enough linear algebra for cameras and the synthetic scenes.
#pragma once

#include <array>
#include <cmath>

namespace editnerf {

struct Vec3 {
  double x = 0, y = 0, z = 0;

  Vec3& operator+=(const Vec3& o) {
    x += o.x, y += o.y, z += o.z;
    return *this;
  }
  friend Vec3 operator+(Vec3 a, const Vec3& b) { return a += b; }
  friend Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vec3 operator-(const Vec3& a) { return {-a.x, -a.y, -a.z}; }
  friend Vec3 operator*(const Vec3& a, double s) { return {a.x * s, a.y * s, a.z * s}; }
  friend Vec3 operator*(double s, const Vec3& a) { return a * s; }
  friend Vec3 operator*(const Vec3& a, const Vec3& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }  // per component
  friend Vec3 operator/(const Vec3& a, double s) { return a * (1 / s); }
};

inline double Dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 Cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double Norm(const Vec3& a) { return std::sqrt(Dot(a, a)); }
inline Vec3 Normalized(const Vec3& a) { return a / Norm(a); }  // undefined for the zero vector

// Two unit vectors across a unit vector, {u, v} with u x v along it.
inline std::array<Vec3, 2> Across(const Vec3& along) {
  const Vec3 u = Normalized(Cross(std::abs(along.z) < 0.7 ? Vec3{0, 0, 1} : Vec3{1, 0, 0}, along));
  return {u, Cross(along, u)};
}

// Row-major.
struct Mat3 {
  std::array<double, 9> m = {1, 0, 0, 0, 1, 0, 0, 0, 1};

  double operator()(int row, int column) const { return m[3 * row + column]; }
  double& operator()(int row, int column) { return m[3 * row + column]; }
  Vec3 Row(int row) const { return {m[3 * row], m[3 * row + 1], m[3 * row + 2]}; }
  Mat3 Transposed() const { return {{m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]}}; }
  friend Vec3 operator*(const Mat3& a, const Vec3& v) { return {Dot(a.Row(0), v), Dot(a.Row(1), v), Dot(a.Row(2), v)}; }
  friend Mat3 operator*(const Mat3& a, const Mat3& b) {
    Mat3 product;
    const Mat3 columns = b.Transposed();
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column) product(row, column) = Dot(a.Row(row), columns.Row(column));
    return product;
  }
};

}  // namespace editnerf
