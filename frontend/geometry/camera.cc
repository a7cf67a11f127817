#include "frontend/geometry/camera.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace cohort {
namespace {

constexpr double kMaxAngle = 89.0 / 180.0 * std::numbers::pi;  // of a ray with the axis

// n_d of n without k3 to k6, and its Jacobian by n. It keeps previous results bit for bit: the
// formula of Distort would round the sums in another order.
Eigen::Vector2d DistortByFour(const Camera& camera,
                              const Eigen::Vector2d& n,
                              Eigen::Matrix2d* jacobian) {
  const double x = n.x();
  const double y = n.y();
  const double r2 = n.squaredNorm();
  const double radial = 1.0 + camera.k1 * r2 + camera.k2 * r2 * r2;
  if (jacobian != nullptr) {
    const double slope = camera.k1 + 2.0 * camera.k2 * r2;  // d radial / d r2
    (*jacobian)(0, 0) = radial + 2.0 * x * x * slope + 2.0 * camera.p1 * y + 6.0 * camera.p2 * x;
    (*jacobian)(0, 1) = 2.0 * x * y * slope + 2.0 * camera.p1 * x + 2.0 * camera.p2 * y;
    (*jacobian)(1, 0) = (*jacobian)(0, 1);
    (*jacobian)(1, 1) = radial + 2.0 * y * y * slope + 6.0 * camera.p1 * y + 2.0 * camera.p2 * x;
  }
  return {x * radial + 2.0 * camera.p1 * x * y + camera.p2 * (r2 + 2.0 * x * x),
          y * radial + camera.p1 * (r2 + 2.0 * y * y) + 2.0 * camera.p2 * x * y};
}

Eigen::Vector2d UndistortByFour(const Camera& camera, const Eigen::Vector2d& distorted) {
  Eigen::Vector2d n = distorted;
  for (int i = 0; i < 30; ++i) {
    Eigen::Matrix2d jacobian;
    const Eigen::Vector2d error = DistortByFour(camera, n, &jacobian) - distorted;
    if (error.norm() < 1e-12) break;
    // Newton's step if the model is invertible, else fixed-point iteration (far outside the image).
    n -= jacobian.determinant() > 0.1 ? Eigen::Vector2d(jacobian.inverse() * error) : error;
  }
  return n;
}

// A function of one variable and its derivative.
struct Growth {
  double value;
  double slope;
};

// theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)
Growth GrowFisheye(const Camera& c, double theta) {
  const double t2 = theta * theta;
  return {theta * (1.0 + t2 * (c.k1 + t2 * (c.k2 + t2 * (c.k3 + t2 * c.k4)))),
          1.0 + t2 * (3.0 * c.k1 + t2 * (5.0 * c.k2 + t2 * (7.0 * c.k3 + t2 * 9.0 * c.k4)))};
}

// The factor in n_d = n factor + tangential, and its derivatives.
struct RadialFactor {
  double factor;
  double slope;             // by r2
  Eigen::Vector2d d_k1_k2;  // by k1, by k2
};

RadialFactor PinholeFactor(const Camera& c, double r2) {
  const double above = 1.0 + r2 * (c.k1 + r2 * (c.k2 + r2 * c.k3));
  const double below = 1.0 + r2 * (c.k4 + r2 * (c.k5 + r2 * c.k6));
  const double above_slope = c.k1 + r2 * (2.0 * c.k2 + r2 * 3.0 * c.k3);
  const double below_slope = c.k4 + r2 * (2.0 * c.k5 + r2 * 3.0 * c.k6);
  const double factor = above / below;
  return {factor, (above_slope - factor * below_slope) / below, {r2 / below, r2 * r2 / below}};
}

RadialFactor FisheyeFactor(const Camera& c, double r2) {
  const double r = std::sqrt(r2);
  if (r < 1e-4) {  // theta = r - r^3 / 3; further terms are below the last digit
    const double slope = c.k1 - 1.0 / 3.0;
    return {1.0 + slope * r2, slope, {r2, r2 * r2}};
  }
  const double theta = std::atan(r);
  const double t2 = theta * theta;
  const Growth growth = GrowFisheye(c, theta);
  const double factor = growth.value / r;
  return {factor,
          (growth.slope / (1.0 + r2) - factor) / (2.0 * r2),
          {t2 * theta / r, t2 * t2 * theta / r}};
}

// The t with f(t) = value on the branch from f(0) = 0 on which f increases, or the end of that
// branch if it ends before.
template <typename Function>
double InvertGrowing(const Function& f, double value, double t_max) {
  constexpr double kStep = 0.05;  // no lens has two turning points within 3 degrees
  double low = 0.0;
  double high = 0.0;
  for (;; low = high) {
    high = std::min(t_max, low + kStep * (1.0 + low));
    const Growth at = f(high);
    if (at.value >= value) break;
    if (at.slope <= 0.0) {
      double growing = low;
      for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (growing + high);
        (f(middle).slope > 0.0 ? growing : high) = middle;
      }
      high = growing;
      if (f(high).value < value) return high;
      break;
    }
    if (high == t_max) return t_max;
  }
  // Newton's steps, or bisection if they leave the bracket.
  double t = 0.5 * (low + high);
  for (int i = 0; i < 100; ++i) {
    const Growth at = f(t);
    const double step = (value - at.value) / at.slope;
    if (std::abs(step) < 1e-9 * (1.0 + t)) return t + step;
    (at.value < value ? low : high) = t;
    t = t + step > low && t + step < high ? t + step : 0.5 * (low + high);
  }
  return t;
}

// n of n_d without the tangential part.
Eigen::Vector2d UndistortRadially(const Camera& camera, const Eigen::Vector2d& distorted) {
  const double length = distorted.norm();
  if (length == 0.0) return distorted;
  if (camera.model == CameraModel::kFisheye) {
    const auto grow = [&camera](double theta) { return GrowFisheye(camera, theta); };
    return distorted * (std::tan(InvertGrowing(grow, length, kMaxAngle)) / length);
  }
  const auto grow = [&camera](double r) -> Growth {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const double r2 = r * r;
    // Beyond the pole of the rational model.
    if (1.0 + r2 * (camera.k4 + r2 * (camera.k5 + r2 * camera.k6)) <= 0.0) return {kInfinity, 1.0};
    const RadialFactor radial = PinholeFactor(camera, r2);
    return {r * radial.factor, radial.factor + 2.0 * r2 * radial.slope};
  };
  return distorted * (InvertGrowing(grow, length, std::tan(kMaxAngle)) / length);
}

Eigen::Vector2d Undistort(const Camera& camera, const Eigen::Vector2d& distorted) {
  Eigen::Vector2d n = UndistortRadially(camera, distorted);
  if (camera.model == CameraModel::kFisheye || (camera.p1 == 0.0 && camera.p2 == 0.0)) return n;
  // With the tangential part: Newton's steps if the model is invertible, shortened until they
  // reduce the error.
  DistortedPoint at = Distort(camera, n);
  for (int i = 0; i < 100 && !(at.d_n.determinant() > 0.0); ++i) at = Distort(camera, n *= 0.9);
  for (int i = 0; i < 50; ++i) {
    const double error = (at.n_d - distorted).norm();
    if (error < 1e-13) break;
    Eigen::Vector2d step = at.d_n.inverse() * (at.n_d - distorted);
    const auto leads_nearer = [&] {
      const DistortedPoint next = Distort(camera, n - step);
      if (!((next.n_d - distorted).norm() < error && next.d_n.determinant() > 0.0)) return false;
      at = next;
      n -= step;
      return true;
    };
    int halvings = 0;
    while (!leads_nearer() && halvings < 10) {
      step *= 0.5;
      ++halvings;
    }
    if (halvings == 10) break;
  }
  return n;
}

}  // namespace

DistortedPoint Distort(const Camera& camera, const Eigen::Vector2d& n) {
  const double r2 = n.squaredNorm();
  const bool fisheye = camera.model == CameraModel::kFisheye;
  const RadialFactor radial = fisheye ? FisheyeFactor(camera, r2) : PinholeFactor(camera, r2);
  DistortedPoint result;
  result.n_d = radial.factor * n;
  result.d_n = radial.factor * Eigen::Matrix2d::Identity() + 2.0 * radial.slope * n * n.transpose();
  result.d_k1_k2 = n * radial.d_k1_k2.transpose();
  if (fisheye) return result;
  const double x = n.x();
  const double y = n.y();
  const double p1 = camera.p1;
  const double p2 = camera.p2;
  result.n_d += Eigen::Vector2d(2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                                p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y);
  const double mixed = 2.0 * p1 * x + 2.0 * p2 * y;
  result.d_n(0, 0) += 2.0 * p1 * y + 6.0 * p2 * x;
  result.d_n(0, 1) += mixed;
  result.d_n(1, 0) += mixed;
  result.d_n(1, 1) += 6.0 * p1 * y + 2.0 * p2 * x;
  return result;
}

std::optional<Eigen::Vector2d> Camera::Project(const Eigen::Vector3d& x_in_cam) const {
  if (x_in_cam.z() <= 0.0) return std::nullopt;
  const auto to_pixel = [this](const Eigen::Vector2d& n) {
    return Eigen::Vector2d(fx * n.x() + cx, fy * n.y() + cy);
  };
  if (HasAtMostFourCoefficients()) {
    return to_pixel(DistortByFour(*this, x_in_cam.hnormalized(), nullptr));
  }
  // Beyond the angle at which the polynomial turns back towards the middle, the lens shows nothing
  // of the scene.
  const DistortedPoint distorted = Distort(*this, x_in_cam.hnormalized());
  if (!(distorted.d_n.determinant() > 0.0)) return std::nullopt;
  return to_pixel(distorted.n_d);
}

Eigen::Vector2d Camera::Unproject(const Eigen::Vector2d& xy) const {
  Eigen::Vector2d distorted((xy.x() - cx) / fx, (xy.y() - cy) / fy);
  if (!HasDistortion()) return distorted;
  return HasAtMostFourCoefficients() ? UndistortByFour(*this, distorted)
                                     : Undistort(*this, distorted);
}

bool Camera::Contains(const Eigen::Vector2d& xy, double border_px) const {
  return xy.x() >= border_px && xy.y() >= border_px && xy.x() <= width_px - 1 - border_px &&
         xy.y() <= height_px - 1 - border_px;
}

Camera Camera::Guess(int width_px, int height_px) {
  return Guess(width_px, height_px, 1.2 * std::max(width_px, height_px), Camera().guess_log_sigma);
}

Camera Camera::Guess(int width_px, int height_px, double focal_px, double log_sigma) {
  Camera camera;
  camera.width_px = width_px;
  camera.height_px = height_px;
  camera.fx = camera.fy = focal_px;
  camera.cx = (width_px - 1) / 2.0;
  camera.cy = (height_px - 1) / 2.0;
  camera.known = false;
  camera.guess_log_sigma = log_sigma;
  return camera;
}

}  // namespace cohort
