// Cameras and vectors, as libeditnerf/geometry/camera.h has them: OpenCV axes, pixel centres at +0.5.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const normalized = (a) => scale(a, 1 / (Math.hypot(...a) || 1));
const axisOf = (camera, row) => camera.orientation.slice(3 * row, 3 * row + 3);

// A point of the scene in pixels of the camera; null at or behind the camera.
function project(camera, point) {
  const offset = sub(point, camera.position);
  const depth = dot(axisOf(camera, 2), offset);
  if (!(depth > 1e-6)) return null;
  const x = dot(axisOf(camera, 0), offset) / depth,
    y = dot(axisOf(camera, 1), offset) / depth;
  const [k, t, r2] = [camera.radial, camera.tangential, x * x + y * y];
  const radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]));
  const xd = x * radial + 2 * t[0] * x * y + t[1] * (r2 + 2 * x * x);
  const yd = y * radial + 2 * t[1] * x * y + t[0] * (r2 + 2 * y * y);
  return {
    u: camera.focal_length * xd + camera.skew * yd + camera.principal_point[0],
    v: camera.focal_length * camera.aspect * yd + camera.principal_point[1],
    depth,
  };
}

// The corners of the image at this depth, without the lens's distortion.
function cornersOf(camera, depth) {
  const corner = (u, v) => {
    const y = (v - camera.principal_point[1]) / (camera.focal_length * camera.aspect);
    const x = (u - camera.principal_point[0] - camera.skew * y) / camera.focal_length;
    const side = add(scale(axisOf(camera, 0), x * depth), scale(axisOf(camera, 1), y * depth));
    return add(camera.position, add(side, scale(axisOf(camera, 2), depth)));
  };
  return [corner(0, 0), corner(camera.width, 0), corner(camera.width, camera.height), corner(0, camera.height)];
}

// What all cameras agree is up.
function upOf(cameras) {
  return normalized(cameras.reduce((sum, camera) => sub(sum, axisOf(camera, 1)), [0, 0, 0]));
}
