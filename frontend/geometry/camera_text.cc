#include "frontend/geometry/camera_text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "frontend/core/error.h"

namespace cohort {
namespace {

constexpr std::size_t kBeforeCoefficients = 4;  // fx fy cx cy
constexpr std::array kPinholeOrder{&Camera::k1,
                                   &Camera::k2,
                                   &Camera::p1,
                                   &Camera::p2,
                                   &Camera::k3,
                                   &Camera::k4,
                                   &Camera::k5,
                                   &Camera::k6};
constexpr std::array kFisheyeOrder{&Camera::k1, &Camera::k2, &Camera::k3, &Camera::k4};
constexpr std::array<std::size_t, 6> kPinholeCounts{0, 1, 2, 4, 5, 8};

std::vector<double> Numbers(std::span<const std::string> words) {
  std::vector<double> numbers;
  for (const std::string& word : words) {
    double number = 0.0;
    const char* const end = word.data() + word.size();
    const auto [stop, error] = std::from_chars(word.data(), end, number);
    if (error != std::errc() || stop != end || !std::isfinite(number)) {
      ThrowError("'{}' is not a number: give {}", word, kCameraForm);
    }
    numbers.push_back(number);
  }
  return numbers;
}

}  // namespace

Camera CameraFromWords(const std::vector<std::string>& words) {
  const std::span<const std::string> all(words);
  if (all.size() < kBeforeCoefficients) {
    ThrowError("{} numbers: give {}", words.size(), kCameraForm);
  }
  const std::vector<double> v = Numbers(all.first(kBeforeCoefficients));
  if (!(v[0] > 0.0 && v[1] > 0.0)) ThrowError("the focal lengths fx and fy must be above 0 px");
  const Camera camera{.fx = v[0], .fy = v[1], .cx = v[2], .cy = v[3]};
  const auto rest = all.subspan(kBeforeCoefficients);
  if (!rest.empty() && rest[0] == NameOf(kCameraModelNames, CameraModel::kFisheye)) {
    return WithDistortion(camera, CameraModel::kFisheye, Numbers(rest.subspan(1)));
  }
  return WithDistortion(camera, CameraModel::kPinhole, Numbers(rest));
}

std::vector<std::string> WordsOfCamera(const Camera& camera) {
  std::vector<std::string> words;
  const auto add = [&](double value) { words.push_back(fmt::format("{}", value)); };
  for (const double value : {camera.fx, camera.fy, camera.cx, camera.cy}) add(value);
  if (camera.model == CameraModel::kFisheye) {
    words.emplace_back(NameOf(kCameraModelNames, camera.model));
    for (const auto coefficient : kFisheyeOrder) add(camera.*coefficient);
    return words;
  }
  const bool five = camera.k4 == 0.0 && camera.k5 == 0.0 && camera.k6 == 0.0;
  const std::size_t count = !camera.HasDistortion()              ? 0
                            : camera.HasAtMostFourCoefficients() ? 4
                            : five                               ? 5
                                                                 : 8;
  for (std::size_t i = 0; i < count; ++i) add(camera.*kPinholeOrder[i]);
  return words;
}

Camera WithDistortion(Camera camera, CameraModel model, std::span<const double> coefficients) {
  const std::size_t count = coefficients.size();
  camera.model = model;
  switch (model) {
    case CameraModel::kPinhole:
      if (std::ranges::find(kPinholeCounts, count) == kPinholeCounts.end()) {
        ThrowError("{} distortion coefficients: a pinhole camera has 0, 1, 2, 4, 5 or 8", count);
      }
      for (std::size_t i = 0; i < count; ++i) camera.*kPinholeOrder[i] = coefficients[i];
      break;
    case CameraModel::kFisheye:
      if (count != kFisheyeOrder.size()) {
        ThrowError("{} distortion coefficients: a fisheye camera has 4", count);
      }
      for (std::size_t i = 0; i < count; ++i) camera.*kFisheyeOrder[i] = coefficients[i];
      break;
  }
  return camera;
}

}  // namespace cohort
