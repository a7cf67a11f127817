#include "datasets/degrade/degrade.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <mutex>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "datasets/degrade/phone_camera.h"
#include "datasets/readers/tum_writer.h"
#include "datasets/readers/video_sequence.h"
#include "datasets/render/texture.h"
#include "frontend/core/error.h"
#include "frontend/core/parallel.h"
#include "frontend/core/random_stream.h"
#include "frontend/core/statistics.h"
#include "frontend/core/time_difference.h"
#include "frontend/image/levels.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr int kBarWidthPx = 80;
constexpr double kGamma = 2.2;
constexpr double kHandMotionPx = 5.0;  // at most, between frames
constexpr double kUsualFramesPerSecond = 30.0;

// Piecewise linear through (0, clean), (1, medium), (2, hard), and extrapolated.
double Straight(double level, double clean, double medium, double hard) {
  return level <= 1.0 ? clean + level * (medium - clean) : medium + (level - 1.0) * (hard - medium);
}

double Geometric(double level, double clean, double medium, double hard) {
  return std::exp(Straight(level, std::log(clean), std::log(medium), std::log(hard)));
}

cv::Mat ToUnit(const cv::Mat& gray) {
  Check(gray.type() == CV_8UC1 || gray.type() == CV_16UC1, "frames are CV_8UC1 or CV_16UC1");
  cv::Mat unit;
  gray.convertTo(unit, CV_32F, 1.0 / WhiteLevelOf(gray));
  return unit;
}

void AddNoise(cv::Mat& image, double sigma, RandomStream& random) {
  for (float& v : cv::Mat_<float>(image)) v += static_cast<float>(sigma * random.Gaussian());
}

// The mean of the picture moved by -motion/2 ... +motion/2, in steps of at most one pixel up to 40
// px, and in the same number of steps beyond.
cv::Mat Smear(const cv::Mat& image, const cv::Mat& motion) {
  double longest = 0.0;
  for (const cv::Vec2f& m : cv::Mat_<cv::Vec2f>(motion)) longest = std::max(longest, cv::norm(m));
  const int steps = 1 + 2 * static_cast<int>(std::ceil(0.5 * std::min(longest, 40.0)));
  if (longest == 0.0) return image;
  cv::Mat here(image.size(), CV_32FC2);
  for (int y = 0; y < here.rows; ++y) {
    for (int x = 0; x < here.cols; ++x) {
      here.at<cv::Vec2f>(y, x) = {static_cast<float>(x), static_cast<float>(y)};
    }
  }
  cv::Mat sum = cv::Mat::zeros(image.size(), CV_32FC1);
  for (int i = 0; i < steps; ++i) {
    const double t = (i + 0.5) / steps - 0.5;
    cv::Mat from;
    cv::scaleAdd(motion, -t, here, from);
    cv::Mat moved;
    cv::remap(image, moved, from, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
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

// Linear light that reaches the sensor.
cv::Mat SensorSignal(cv::Mat image,
                     const SensorLevel& level,
                     cv::Mat motion,
                     RandomStream& random) {
  constexpr int kMostSidePx = 32766;  // of OpenCV's remap
  if (std::max(image.cols, image.rows) > kMostSidePx) {
    ThrowError("pictures of {}x{}: the recipes sensor and phone support sides of up to {} px",
               image.cols,
               image.rows,
               kMostSidePx);
  }
  cv::pow(image, kGamma, image);
  const double angle = random.Uniform(0.0, 2.0 * std::numbers::pi);
  const double hand_px = kHandMotionPx * random.Uniform();
  if (motion.empty()) {
    motion = cv::Mat(
        image.size(), CV_32FC2, cv::Scalar(hand_px * std::cos(angle), hand_px * std::sin(angle)));
  }
  return level.gain * Smear(image, level.shutter * motion);
}

RandomStream NoiseStream(const DegradeOptions& options, std::uint32_t frame) {
  return RandomStream(options.seed, "degrade/noise").Fork(frame);
}

cv::Mat Sensor(const cv::Mat& gray,
               const DegradeOptions& options,
               std::uint32_t frame,
               const cv::Mat& motion) {
  const SensorLevel level = SensorLevelAt(options.level, options.light);
  cv::Mat image = MeasuredLight(gray, options, frame, motion);
  image = cv::max(level.digital_gain * image, 0.0);
  cv::pow(image, 1.0 / kGamma, image);
  return image;
}

// The pattern of the bar, CV_32FC1 in 0..1.
cv::Mat BarPattern(int height_px, unsigned seed) {
  constexpr double kTexelsPerMetre = 100.0;
  const TextureSpec spec{.material = Material::kPoster,
                         .width_m = kBarWidthPx / kTexelsPerMetre,
                         .height_m = height_px / kTexelsPerMetre,
                         .texels_per_m = kTexelsPerMetre,
                         .brightness = 1.0};
  cv::Mat pattern;
  cv::pow(MakeTexture(spec, RandomStream(seed, "degrade/occluder")), 1.0 / kGamma, pattern);
  return pattern;
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

PaperLevel PaperLevelAt(double level) {
  return {Geometric(level, 1.0, 0.3, 0.2),
          Straight(level, 0.004, 0.04, 0.06),
          std::min(2.0, 2.0 * level),
          Straight(level, 0.0, 0.02, 0.03)};
}

SensorLevel SensorLevelAt(double level, double light) {
  const double gain = light * Geometric(level, 1.0, 0.08, 0.04);
  const double shot = Geometric(level, 1e-4, 0.006, 0.012);
  return {gain,
          shot,
          std::exp(2.18 * std::log(shot) + 1.2),
          std::max(1.0, 0.2 / gain),
          std::min(1.0, Straight(level, 0.0, 0.35, 0.6))};
}

cv::Mat DegradeFrame(const cv::Mat& gray,
                     const DegradeOptions& options,
                     std::uint32_t frame,
                     const cv::Mat& motion) {
  cv::Mat image;
  switch (options.recipe) {
    case DegradeRecipe::kPaper: {
      RandomStream random = NoiseStream(options, frame);
      image = Paper(ToUnit(gray), PaperLevelAt(options.level), random);
      break;
    }
    case DegradeRecipe::kSensor:
      image = Sensor(gray, options, frame, motion);
      break;
    case DegradeRecipe::kPhone:
      Check(false, "a phone's frame depends on those before it");
  }
  cv::Mat out;
  image.convertTo(out, CV_8U, 255.0);
  return out;
}

cv::Mat MeasuredLight(const cv::Mat& gray,
                      const DegradeOptions& options,
                      std::uint32_t frame,
                      const cv::Mat& motion) {
  const SensorLevel level = SensorLevelAt(options.level, options.light);
  RandomStream random = NoiseStream(options, frame);
  cv::Mat image = SensorSignal(ToUnit(gray), level, motion, random);
  for (float& v : cv::Mat_<float>(image)) {
    v += static_cast<float>(std::sqrt(level.shot * v + level.read) * random.Gaussian());
  }
  return image;
}

cv::Mat TrueMotion(const Sequence& sequence,
                   const std::optional<Camera>& camera,
                   FrameIndex frame,
                   const cv::Mat& depth_m) {
  const std::map<FrameIndex, Rigid3>& poses = sequence.TrueCamFromWorld();
  const auto here = poses.find(frame);
  if (here == poses.end() || depth_m.empty() || !camera) return {};
  const auto next = poses.find(FrameIndex(ToInt(frame) + 1));
  const auto previous = ToInt(frame) == 0 ? poses.end() : poses.find(FrameIndex(ToInt(frame) - 1));
  const auto after = next == poses.end() ? here : next;
  const auto before = previous == poses.end() ? here : previous;
  if (after == before) return {};
  const double frames = static_cast<double>(ToInt(after->first) - ToInt(before->first));
  const Rigid3 world_from_cam = here->second.Inverse();
  const Rigid3 after_from_here = after->second * world_from_cam;
  const Rigid3 before_from_here = before->second * world_from_cam;

  // Unknown depths are replaced by the median of the known ones.
  std::vector<double> known;
  for (const float z : cv::Mat_<float>(depth_m)) {
    if (z > 0.0F) known.push_back(z);
  }
  if (known.empty()) return {};
  const auto usual = static_cast<float>(Median(std::move(known)));

  constexpr int kStep = 4;  // dense enough for a blur
  cv::Mat coarse((depth_m.rows + kStep - 1) / kStep, (depth_m.cols + kStep - 1) / kStep, CV_32FC2);
  for (int y = 0; y < coarse.rows; ++y) {
    for (int x = 0; x < coarse.cols; ++x) {
      const cv::Point at(std::min(kStep * x + kStep / 2, depth_m.cols - 1),
                         std::min(kStep * y + kStep / 2, depth_m.rows - 1));
      const float z = depth_m.at<float>(at);
      const Eigen::Vector2d pixel(at.x, at.y);
      const Eigen::Vector3d x_in_cam =
          (z > 0.0F ? z : usual) * camera->Unproject(pixel).homogeneous();
      const auto end = camera->Project(after_from_here * x_in_cam);
      const auto begin = camera->Project(before_from_here * x_in_cam);
      const Eigen::Vector2d motion =
          begin && end ? Eigen::Vector2d((*end - *begin) / frames) : Eigen::Vector2d::Zero();
      coarse.at<cv::Vec2f>(y, x) = {static_cast<float>(motion.x()), static_cast<float>(motion.y())};
    }
  }
  cv::Mat motion;
  cv::resize(coarse, motion, depth_m.size(), 0, 0, cv::INTER_LINEAR);
  return motion;
}

cv::Mat NoiseFreeSignal(const cv::Mat& gray,
                        const DegradeOptions& options,
                        std::uint32_t frame,
                        const cv::Mat& motion) {
  cv::Mat image = ToUnit(gray);
  switch (options.recipe) {
    case DegradeRecipe::kPaper: {
      const PaperLevel level = PaperLevelAt(options.level);
      image *= level.gain;
      if (level.blur_px > 0.0) cv::GaussianBlur(image, image, cv::Size(0, 0), level.blur_px);
      return image;
    }
    case DegradeRecipe::kSensor:
    case DegradeRecipe::kPhone: {
      RandomStream random = NoiseStream(options, frame);
      return SensorSignal(image, SensorLevelAt(options.level, options.light), motion, random);
    }
  }
  ThrowUsageError("unknown recipe");
}

OccludedFrame DrawOccluder(const cv::Mat& gray,
                           const DegradeOptions& options,
                           std::uint32_t frame) {
  OccludedFrame result{gray.clone(), cv::Mat::zeros(gray.size(), CV_8UC1)};
  const double path_px = 2.0 * gray.cols + kBarWidthPx;
  const double travelled = std::fmod(options.occluder_px_per_frame * frame, path_px);
  const int left = static_cast<int>(std::lround(travelled)) - kBarWidthPx;
  const cv::Rect bar =
      cv::Rect(left, 0, kBarWidthPx, gray.rows) & cv::Rect(0, 0, gray.cols, gray.rows);
  if (bar.empty()) return result;
  result.mask(bar) = 255;
  cv::Mat pattern;
  BarPattern(gray.rows, options.seed).convertTo(pattern, gray.depth(), WhiteLevelOf(gray));
  pattern(bar - cv::Point(left, 0)).copyTo(result.gray(bar));
  return result;
}

namespace {

// Degrades the frames of a sequence into a folder, on as many threads as call Work; one thread at a
// time reads the sequence.
class SequenceDegrader {
 public:
  SequenceDegrader(Sequence& sequence,
                   const std::optional<Camera>& camera,
                   const DegradeOptions& options,
                   const Progress& progress,
                   TumWriter& writer)
      : sequence_(sequence),
        camera_(camera),
        options_(options),
        progress_(progress),
        writer_(writer) {}

  // Runs until the sequence ends or another thread fails.
  void Work() {
    try {
      while (auto job = NextJob()) {
        Degrade(*job);
        writer_.Write(job->place, job->record);
        const std::lock_guard lock(mutex_);
        if (progress_) progress_(++done_, sequence_.FrameCount().value_or(0));
      }
    } catch (...) {
      const std::lock_guard lock(mutex_);
      at_end_ = true;
      throw;
    }
  }

  // Recipe phone: passes all frames in order through one camera and one encoder, and decodes them.
  void Film(unsigned threads) {
    const fs::path video = writer_.partial() / "rgb.partial.mp4";
    std::optional<PhoneCamera> camera;
    std::optional<VideoEncoder> encoder;
    std::vector<Job> jobs;  // without their pictures
    const double frames_per_second = FramesPerSecond();
    const std::size_t at_once = 4 * ThreadCount(threads);
    for (auto batch = NextJobs(at_once); !batch.empty(); batch = NextJobs(at_once)) {
      if (!encoder) {
        camera.emplace(options_, frames_per_second);
        encoder.emplace(video, batch[0].frame.gray.size());
      }
      ParallelFor(batch.size(), threads, [&](std::size_t i) { Degrade(batch[i]); });
      for (Job& job : batch) {
        encoder->Add(camera->Next(job.record.picture));
        jobs.push_back(WithoutPictures(job));
        if (progress_) progress_(++done_, sequence_.FrameCount().value_or(0));
      }
    }
    if (!encoder) return;
    const int bitrate_kbit = options_.bitrate_kbit > 0 ? options_.bitrate_kbit
                                                       : PhoneBitrateKbit(size_, frames_per_second);
    encoder->Finish(options_.codec, bitrate_kbit, frames_per_second);
    encoder.reset();
    WriteDecoded(video, jobs);
    fs::remove(video);
  }

  // The frames of the source that were degraded.
  const std::vector<FrameIndex>& frames() const { return frames_; }

 private:
  struct Job {
    Frame frame;
    std::size_t place = 0;  // of the frame in the new clip
    TumWriter::Record record;
  };

  std::optional<Job> NextJob() {
    const std::lock_guard lock(mutex_);
    if (at_end_) return std::nullopt;
    auto frame = sequence_.Next();
    at_end_ = !frame;
    if (!frame) return std::nullopt;
    Job job{std::move(*frame), frames_.size(), {}};
    frames_.push_back(job.frame.index);
    size_ = job.frame.gray.size();
    job.record.timestamp_ns = job.frame.timestamp_ns;
    ReadTruePictures(job);
    const std::map<FrameIndex, Rigid3>& poses = sequence_.TrueCamFromWorld();
    if (const auto pose = poses.find(job.frame.index); pose != poses.end()) {
      job.record.cam_from_world = pose->second;
    }
    return job;
  }

  std::vector<Job> NextJobs(std::size_t most) {
    std::vector<Job> jobs;
    while (jobs.size() < most) {
      auto job = NextJob();
      if (!job) break;
      jobs.push_back(std::move(*job));
    }
    return jobs;
  }

  void ReadTruePictures(Job& job) const {
    job.record.depth_m = sequence_.TrueDepth(job.frame.index);
    job.record.occluder = sequence_.OccluderMask(job.frame.index);
  }

  // Without pictures, the jobs of a whole clip need little memory.
  static Job WithoutPictures(const Job& job) {
    Job small = job;
    small.frame.gray.release();
    small.record.picture.release();
    small.record.depth_m.reset();
    small.record.occluder.reset();
    return small;
  }

  // The median over the first frames, independent of the number of threads, since some frames may
  // be missing or late.
  double FramesPerSecond() {
    constexpr std::size_t kIntervals = 31;
    std::vector<double> intervals_ns;
    std::optional<std::int64_t> before_ns;
    while (intervals_ns.size() < kIntervals) {
      const auto frame = sequence_.Next();
      if (!frame) break;
      if (before_ns) intervals_ns.push_back(TimeFromTo(*before_ns, frame->timestamp_ns));
      before_ns = frame->timestamp_ns;
    }
    sequence_.Rewind();
    const double ns = Median(std::move(intervals_ns));
    return ns > 0.0 ? std::clamp(1e9 / ns, 1.0, 1000.0) : kUsualFramesPerSecond;
  }

  void WriteDecoded(const fs::path& video, std::vector<Job>& jobs) {
    const auto decoded = OpenVideo(video, {});
    for (Job& job : jobs) {
      const auto frame = decoded->Next();
      if (!frame) ThrowError("{} lost frames: check the ffmpeg installation", video.string());
      ReadTruePictures(job);
      if (options_.occluder_px_per_frame > 0.0) {
        const cv::Mat blank(size_, CV_8UC1, cv::Scalar(0));
        AddOccluder(DrawOccluder(blank, options_, ToInt(job.frame.index)).mask, job.record);
      }
      if (frame->gray.cols < size_.width || frame->gray.rows < size_.height) {
        ThrowError("{} has frames of {}x{} instead of {}x{}: check the ffmpeg installation",
                   video.string(),
                   frame->gray.cols,
                   frame->gray.rows,
                   size_.width,
                   size_.height);
      }
      job.record.picture = frame->gray(cv::Rect({}, size_));
      writer_.Write(job.place, job.record);
      job = WithoutPictures(job);
    }
  }

  void Degrade(Job& job) const {
    TumWriter::Record& record = job.record;
    const std::uint32_t index = ToInt(job.frame.index);
    cv::Mat motion;
    if (options_.recipe != DegradeRecipe::kPaper) {
      motion = TrueMotion(sequence_, camera_, job.frame.index, record.depth_m.value_or(cv::Mat()));
    }
    cv::Mat gray = job.frame.gray;
    if (options_.occluder_px_per_frame > 0.0) {
      const OccludedFrame occluded = DrawOccluder(gray, options_, index);
      gray = occluded.gray;
      AddOccluder(occluded.mask, record);
      if (!motion.empty()) {
        motion.setTo(cv::Scalar(options_.occluder_px_per_frame, 0.0), occluded.mask);
      }
    }
    record.picture = options_.recipe == DegradeRecipe::kPhone
                         ? MeasuredLight(gray, options_, index, motion)
                         : DegradeFrame(gray, options_, index, motion);
  }

  static void AddOccluder(const cv::Mat& mask, TumWriter::Record& record) {
    record.occluder = record.occluder ? *record.occluder | mask : mask;
  }

  Sequence& sequence_;
  const std::optional<Camera>& camera_;
  const DegradeOptions& options_;
  const Progress& progress_;
  TumWriter& writer_;
  std::mutex mutex_;  // guards the members below and reading the sequence
  std::vector<FrameIndex> frames_;
  cv::Size size_;
  bool at_end_ = false;
  std::size_t done_ = 0;
};

// The scene file of a clip that consists of these frames of a rendered scene.
SceneFile PartOfScene(const SceneFile& scene, const std::vector<FrameIndex>& frames) {
  SceneFile part = scene;
  part.first_frame = scene.FrameOf(frames[0]);
  if (frames.size() > 1) part.frame_step = scene.FrameOf(frames[1]) - part.first_frame;
  return part;
}

}  // namespace

void DegradeSequence(Sequence& sequence,
                     const fs::path& source,
                     const std::optional<Camera>& camera,
                     const DegradeOptions& options,
                     const fs::path& out,
                     const Progress& progress,
                     unsigned threads) {
  ValidateOptions(options);
  std::error_code ignored;
  if (fs::equivalent(source, out, ignored)) {
    ThrowError("{} is the input itself: give another folder", out.string());
  }
  TumWriter writer(out);
  if (camera) writer.WriteCamera(*camera);
  SequenceDegrader degrader(sequence, camera, options, progress, writer);
  if (options.recipe == DegradeRecipe::kPhone) {
    degrader.Film(threads);
  } else {
    ParallelFor(ThreadCount(threads), threads, [&](std::size_t) { degrader.Work(); });
  }
  if (degrader.frames().empty()) {
    const std::string& why = sequence.Warning();
    ThrowError(
        "{}: there is no frame to degrade{}{}", source.string(), why.empty() ? "" : ": ", why);
  }
  if (const auto scene = fs::is_directory(source) ? ReadSceneFile(source) : std::nullopt) {
    writer.WriteFile("scene.json", PartOfScene(*scene, degrader.frames()).Text());
  }
  writer.Finish();
}

}  // namespace cohort
