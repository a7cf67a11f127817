#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "frontend/core/random_stream.h"
#include "tests/support/closed_form_image.h"

// Clips that are hard to track, or that show nothing, in closed form: CV_8UC1.
namespace cohort::test {

using Pictures = std::vector<cv::Mat>;

inline constexpr int kHardWidth = 160;
inline constexpr int kHardHeight = 120;
inline constexpr int kHardFrames = 8;

// Picture t is value_at(x, y, t), intensities 0..1.
template <typename Function>
Pictures ClipOf(const Function& value_at, int frames = kHardFrames) {
  Pictures pictures;
  for (int t = 0; t < frames; ++t) {
    pictures.push_back(ImageOf(
        [&](double x, double y) { return value_at(x, y, t); }, kHardWidth, kHardHeight, CV_8U));
  }
  return pictures;
}

inline Pictures EvenClip(double value) {
  return ClipOf([=](double, double, int) { return value; });
}

// Where what MovingClip shows goes in a frame [px].
inline const Eigen::Vector2d kMovingPx(1.7, -0.6);

// Texture that goes by; `place` is where in the endless texture it begins, so that two places have
// nothing in common.
inline Pictures MovingClip(double place = 0.0, int frames = kHardFrames, int first = 0) {
  return ClipOf(
      [=](double x, double y, int t) {
        const Eigen::Vector2d shift = kMovingPx * (t + first);
        return NoiseAt(place + x - shift.x(), 0.5 * place + y - shift.y());
      },
      frames);
}

// Noise of the sensor, and nothing else.
inline Pictures NoiseClip(double light) {
  RandomStream random(3, "test/hard");
  return ClipOf(
      [&](double, double, int) { return std::clamp(light + 0.02 * random.Gaussian(), 0.0, 1.0); });
}

inline Pictures StaticClip() {
  return ClipOf([](double x, double y, int) { return NoiseAt(x, y); });
}

// A camera that turns on its spot by 0.8 degrees a frame about a tilted axis.
inline Pictures TurningClip(int frames = kHardFrames) {
  constexpr double kFocalPx = 150.0;
  const Eigen::Vector2d middle(0.5 * kHardWidth, 0.5 * kHardHeight);
  return ClipOf(
      [=](double x, double y, int t) {
        const Eigen::Vector3d ray((x - middle.x()) / kFocalPx, (y - middle.y()) / kFocalPx, 1.0);
        const Eigen::Vector3d turned =
            Eigen::AngleAxisd(0.014 * t, Eigen::Vector3d(0.3, 1.0, 0.2).normalized()) * ray;
        return NoiseAt(500 + kFocalPx * turned.x() / turned.z(),
                       300 + kFocalPx * turned.y() / turned.z());
      },
      frames);
}

// A camera that goes past a plane, obliquely: no depth but the plane's.
inline Pictures PlaneOnlyClip(int frames = kHardFrames) {
  constexpr double kFocalPx = 150.0;
  const Eigen::Vector3d normal = Eigen::Vector3d(0.5, 0.1, -1.0).normalized();
  return ClipOf(
      [=](double x, double y, int t) {
        const Eigen::Vector3d ray(
            (x - 0.5 * kHardWidth) / kFocalPx, (y - 0.5 * kHardHeight) / kFocalPx, 1.0);
        const Eigen::Vector3d centre(0.03 * t, 0.01 * t, 0.02 * t);
        const double depth =
            (-3.0 - normal.dot(centre)) / normal.dot(ray);  // the plane: normal'X = -3
        const Eigen::Vector3d point = centre + depth * ray;
        return NoiseAt(500 + 50.0 * point.x(), 300 + 50.0 * point.y());
      },
      frames);
}

// A chessboard, fields of 12 px, that moves by 3 px a frame.
inline Pictures ChessboardClip() {
  return ClipOf([](double x, double y, int t) {
    const double wave = std::sin((x - 3.0 * t) * 3.14159265 / 12) * std::sin(y * 3.14159265 / 12);
    return 0.5 + 0.4 * std::clamp(4.0 * wave, -1.0, 1.0);
  });
}

// Dots on an even ground, in the middle of each a peak.
inline double DotsAt(double x, double y, const std::vector<Eigen::Vector2d>& dots) {
  double value = 0.3;
  for (const Eigen::Vector2d& dot : dots) {
    value += 0.6 * std::exp(-((x - dot.x()) * (x - dot.x()) + (y - dot.y()) * (y - dot.y())) / 18);
  }
  return std::min(value, 1.0);
}

// Nine dots on a line that moves along with them.
inline Pictures LineOfDotsClip() {
  return ClipOf([](double x, double y, int t) {
    std::vector<Eigen::Vector2d> dots;
    for (int i = 0; i < 9; ++i) dots.emplace_back(20 + 14 * i + 0.8 * t, 30 + 5 * i + 0.4 * t);
    return DotsAt(x, y, dots);
  });
}

// Two dots: fewer than any rank of their motion.
inline Pictures TwoDotsClip() {
  return ClipOf([](double x, double y, int t) {
    return DotsAt(x, y, {{50 + 1.2 * t, 60.0}, {110 + 1.2 * t, 50 + 0.3 * t}});
  });
}

// Two rows of dots that meet: features end up on top of each other.
inline Pictures MeetingDotsClip() {
  return ClipOf([](double x, double y, int t) {
    std::vector<Eigen::Vector2d> dots;
    for (int i = 0; i < 6; ++i) {
      dots.emplace_back(25 + 22 * i, 40 + 2.2 * t);
      dots.emplace_back(25 + 22 * i, 74 - 2.2 * t);
    }
    return DotsAt(x, y, dots);
  });
}

// The pictures of `clip` in another order; some twice, some never.
inline Pictures Reordered(const Pictures& clip, const std::vector<int>& order) {
  Pictures pictures;
  for (const int i : order) pictures.push_back(clip.at(static_cast<std::size_t>(i)));
  return pictures;
}

// From frame `from` on the light is `gain` times as strong, at most white.
inline Pictures ExposedAnew(Pictures clip, int from, double gain) {
  for (std::size_t t = static_cast<std::size_t>(from); t < clip.size(); ++t) {
    clip[t].convertTo(clip[t], CV_8U, gain);
  }
  return clip;
}

// One clip after the other.
inline Pictures Joined(Pictures a, const Pictures& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// In the place of frame 4 an even one.
inline Pictures FrameLostClip(double value) {
  Pictures pictures = MovingClip(0.0, 9);
  pictures[4].setTo(255.0 * value);
  return pictures;
}

// By name; pictures are made when a clip is called for.
inline std::map<std::string, std::function<Pictures()>> HardClips() {
  const auto moving_in_order = [](std::vector<int> order) {
    return [order = std::move(order)] { return Reordered(MovingClip(0.0, 14), order); };
  };
  return {{"NoTexture", [] { return EvenClip(0.5); }},
          {"Black", [] { return EvenClip(0.0); }},
          {"White", [] { return EvenClip(1.0); }},
          {"NoiseAlone", [] { return NoiseClip(0.1); }},
          {"NothingMoves", [] { return StaticClip(); }},
          {"StillAtFirst",
           [] { return Joined(Pictures(8, MovingClip().front()), MovingClip(0.0, 8, 1)); }},
          {"CameraThatTurns", [] { return TurningClip(); }},
          {"OnePlane", [] { return PlaneOnlyClip(); }},
          {"RepeatedPattern", [] { return ChessboardClip(); }},
          {"FeaturesOnALine", [] { return LineOfDotsClip(); }},
          {"FewerFeaturesThanTheRank", [] { return TwoDotsClip(); }},
          {"FeaturesThatMeet", [] { return MeetingDotsClip(); }},
          {"FramesDropped", moving_in_order({0, 1, 2, 6, 7, 8, 12, 13})},
          {"FramesRepeated", moving_in_order({0, 1, 1, 1, 2, 3, 3, 4})},
          {"FramesOutOfOrder", moving_in_order({0, 2, 1, 4, 3, 6, 5, 7})},
          {"SuddenlyDarker", [] { return ExposedAnew(MovingClip(), 4, 0.35); }},
          {"SuddenlyBrighter", [] { return ExposedAnew(MovingClip(), 4, 1.8); }},
          {"FrameLost", [] { return FrameLostClip(0.0); }},
          {"Cut", [] { return Joined(MovingClip(0.0, 5), MovingClip(4000.0, 5)); }},
          {"TwoScenesInTurn", [] {
             return Joined(Joined(MovingClip(0.0, 3), MovingClip(4000.0, 3)),
                           MovingClip(0.0, 3, 3));
           }}};
}

}  // namespace cohort::test
