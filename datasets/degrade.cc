#include "datasets/degrade.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "datasets/tum_writer.h"
#include "frontend/core/output.h"
#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

constexpr int kBarWidthPx = 80;

// Through (0, clean), (1, medium), (2, hard) and beyond, straight in the logarithm.
double Geometric(double level, double clean, double medium, double hard) {
  const double l = level <= 1.0 ? std::log(clean) + level * std::log(medium / clean)
                                : std::log(medium) + (level - 1.0) * std::log(hard / medium);
  return std::exp(l);
}

double Straight(double level, double clean, double medium, double hard) {
  return level <= 1.0 ? clean + level * (medium - clean) : medium + (level - 1.0) * (hard - medium);
}

cv::Mat ToUnit(const cv::Mat& gray) {
  cv::Mat unit;
  gray.convertTo(unit, CV_32F, gray.depth() == CV_16U ? 1.0 / 65535.0 : 1.0 / 255.0);
  return unit;
}

void AddNoise(cv::Mat& image, double sigma, RandomStream& random) {
  for (float& v : cv::Mat_<float>(image)) v += static_cast<float>(sigma * random.Gaussian());
}

// The mean of pictures shifted along a straight line through the origin: a hand that moves steadily
// while the shutter is open.
cv::Mat Smear(const cv::Mat& image, const Eigen::Vector2d& shift) {
  const int steps = static_cast<int>(std::ceil(shift.norm() * 2.0)) + 1;
  if (steps <= 1) return image;
  cv::Mat sum = cv::Mat::zeros(image.size(), CV_32FC1);
  for (int i = 0; i < steps; ++i) {
    const double t = static_cast<double>(i) / (steps - 1) - 0.5;
    const cv::Matx23d move(1, 0, t * shift.x(), 0, 1, t * shift.y());
    cv::Mat moved;
    cv::warpAffine(image, moved, move, image.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    sum += moved;
  }
  return sum / steps;
}

cv::Mat Paper(cv::Mat image, const PaperLevel& level, RandomStream& random) {
  image *= level.gain;
  AddNoise(image, level.noise_before, random);
  if (level.blur_px > 0.0) cv::GaussianBlur(image, image, cv::Size(0, 0), level.blur_px);
  if (level.noise_after > 0.0) AddNoise(image, level.noise_after, random);
  return image;
}

cv::Mat Sensor(cv::Mat image, const SensorLevel& level, RandomStream& random) {
  cv::pow(image, 2.2, image);
  const double angle = random.Uniform(0.0, 2.0 * std::numbers::pi);
  const double length = level.motion_blur_px * random.Uniform();
  image = Smear(image, length * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  image *= level.gain;
  for (float& v : cv::Mat_<float>(image)) {
    v += static_cast<float>(std::sqrt(level.shot * std::max(v, 0.0F) + level.read) *
                            random.Gaussian());
  }
  const double digital_gain = std::max(1.0, 0.2 / level.gain);
  image = cv::max(image * digital_gain, 0.0);
  cv::pow(image, 1.0 / 2.2, image);
  return image;
}

}  // namespace

double ParseLevel(const std::string& text) {
  if (text == "clean") return 0.0;
  if (text == "medium") return 1.0;
  if (text == "hard") return 2.0;
  double level = -1.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), level);
  if (error != std::errc() || end != text.data() + text.size() ||
      !(level >= 0.0 && level <= 10.0)) {
    ThrowUsageError("level '{}' is unknown: give clean, medium, hard or a number from 0 to 10",
                    text);
  }
  return level;
}

PaperLevel PaperLevelOf(double level) {
  return {Geometric(level, 1.0, 0.3, 0.2),
          Geometric(level, 0.004, 0.04, 0.06),
          std::min(2.0, 2.0 * level),
          Straight(level, 0.0, 0.02, 0.03)};
}

SensorLevel SensorLevelOf(double level) {
  const double shot = Geometric(level, 1e-4, 0.006, 0.012);
  return {Geometric(level, 1.0, 0.08, 0.04),
          shot,
          std::exp(2.18 * std::log(shot) + 1.2),
          Straight(level, 0.0, 1.5, 3.0)};
}

cv::Mat DegradeFrame(const cv::Mat& gray, const DegradeOptions& options, std::uint32_t frame) {
  RandomStream random = RandomStream(options.seed, "degrade/noise").Fork(frame);
  cv::Mat image = ToUnit(gray);
  switch (options.recipe) {
    case DegradeRecipe::kPaper:
      image = Paper(image, PaperLevelOf(options.level), random);
      break;
    case DegradeRecipe::kSensor:
      image = Sensor(image, SensorLevelOf(options.level), random);
      break;
  }
  cv::Mat out;
  image.convertTo(out, CV_8U, 255.0);
  return out;
}

OccludedFrame DrawOccluder(const cv::Mat& gray,
                           const DegradeOptions& options,
                           std::uint32_t frame) {
  OccludedFrame result{gray.clone(), cv::Mat::zeros(gray.size(), CV_8UC1)};
  // Out of the picture for as long as it is in it: from -W - 80 to W.
  const double course = 2.0 * gray.cols + kBarWidthPx;
  const double travelled = std::fmod(options.occluder_px_per_frame * frame, course);
  const int left = static_cast<int>(std::lround(travelled)) - kBarWidthPx;
  const cv::Rect bar =
      cv::Rect(left, 0, kBarWidthPx, gray.rows) & cv::Rect(0, 0, gray.cols, gray.rows);
  if (bar.empty()) return result;
  result.mask(bar) = 255;
  // The pattern is drawn once, as wide as the bar, and moves with it.
  cv::Mat pattern(gray.rows, kBarWidthPx, CV_32FC1);
  RandomStream random(options.seed, "degrade/occluder");
  for (float& v : cv::Mat_<float>(pattern)) v = static_cast<float>(random.Gaussian());
  cv::Mat coarse;
  cv::GaussianBlur(pattern, coarse, cv::Size(0, 0), 12.0);
  cv::GaussianBlur(pattern, pattern, cv::Size(0, 0), 3.0);
  pattern = 0.45 + 1.3 * pattern + 4.0 * coarse;
  const double full = gray.depth() == CV_16U ? 65535.0 : 255.0;
  cv::Mat units;
  pattern.convertTo(units, gray.depth(), full);
  units(cv::Rect(bar.x - left, 0, bar.width, gray.rows)).copyTo(result.gray(bar));
  return result;
}

void DegradeSequence(Sequence& sequence,
                     const std::filesystem::path& source,
                     const DegradeOptions& options,
                     const std::filesystem::path& out,
                     const Progress& progress) {
  ValidateOptions(options);
  TumWriter writer(out);
  if (const auto camera = sequence.KnownCamera()) writer.WriteCamera(*camera);
  const auto& truth = sequence.TrueCamFromWorld();
  const std::size_t total = sequence.FrameCount().value_or(0);
  std::size_t done = 0;
  while (const auto frame = sequence.Next()) {
    cv::Mat gray = frame->gray;
    if (options.occluder_px_per_frame > 0.0) {
      const OccludedFrame occluded = DrawOccluder(gray, options, ToInt(frame->index));
      gray = occluded.gray;
      writer.AddOccluder(occluded.mask, frame->timestamp_ns);
    }
    writer.AddFrame(DegradeFrame(gray, options, ToInt(frame->index)), frame->timestamp_ns);
    if (const auto it = truth.find(frame->index); it != truth.end()) {
      writer.AddPose(it->second, frame->timestamp_ns);
    }
    if (const auto depth = sequence.TrueDepth(frame->index)) {
      writer.AddDepth(*depth, frame->timestamp_ns);
    }
    ++done;
    if (progress) progress(done, std::max(total, done));
  }
  // Valid only while the frames are those of the scene: one range with a stride would not be.
  if (std::filesystem::is_directory(source) && ReadSceneFile(source) &&
      static_cast<std::size_t>(ReadSceneFile(source)->frames) == done) {
    writer.AddFile("scene.json", ReadBytes(source / "scene.json"));
  }
  writer.Finish();
}

}  // namespace cohort
