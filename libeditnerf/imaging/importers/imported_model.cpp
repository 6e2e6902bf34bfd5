#include "libeditnerf/imaging/importers/imported_model.h"

#include "libeditnerf/base/error.h"

namespace editnerf {

Mat3 NearestRotation(const Mat3& m, const std::string& where) {
  const Vec3 x = Normalized(m.Row(0));
  const Vec3 y = Normalized(m.Row(1) - x * Dot(x, m.Row(1)));
  const Vec3 z = Cross(x, y);
  const Mat3 rotation = {{x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z}};
  for (size_t i = 0; i < 9; ++i) {
    if (!(std::abs(rotation.m[i] - m.m[i]) < 1e-2)) {  // also for NaN
      Throw<DataError>("{}: expected a rotation matrix", where);
    }
  }
  return rotation;
}

}  // namespace editnerf
