#include "backend/scene/frame_times.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include "frontend/core/statistics.h"

namespace cohort {
namespace {

// A frame of the clip, repeats included.
struct Shown {
  FrameIndex index;
  double ns;
};

std::vector<Shown> AllShown(const TrackFile& file) {
  std::vector<Shown> shown;
  for (const FrameInfo& frame : file.frames) {
    shown.push_back({frame.index, static_cast<double>(frame.timestamp_ns)});
  }
  for (const RepeatedFrame& repeat : file.repeats) {
    shown.push_back({repeat.frame.index, static_cast<double>(repeat.frame.timestamp_ns)});
  }
  std::ranges::sort(shown, {}, &Shown::index);
  return shown;
}

double IndexStep(FrameIndex from, FrameIndex to) {
  return static_cast<double>(ToInt(to)) - static_cast<double>(ToInt(from));
}

// The time of every frame by its stamp, in median intervals between indices. nullopt if most stamps
// do not ascend. One that does not ascend counts as one interval.
std::optional<FrameTimes> TimesOfStamps(const std::vector<Shown>& shown) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < shown.size(); ++i) {
    const double ns = shown[i].ns - shown[i - 1].ns;
    if (ns > 0.0) intervals.push_back(ns / IndexStep(shown[i - 1].index, shown[i].index));
  }
  if (2 * intervals.size() < shown.size()) return std::nullopt;
  const double interval = Median(std::move(intervals));
  constexpr double kLeastStep = 0.05;  // stamps that nearly coincide
  FrameTimes times;
  double time = ToInt(shown.front().index);
  times[shown.front().index] = time;
  for (std::size_t i = 1; i < shown.size(); ++i) {
    const double ns = shown[i].ns - shown[i - 1].ns;
    time += ns > 0.0 ? std::max(kLeastStep, ns / interval)
                     : IndexStep(shown[i - 1].index, shown[i].index);
    times[shown[i].index] = time;
  }
  return times;
}

// Whether the times lie on a straight line over the indices.
bool AreEven(const FrameTimes& times) {
  constexpr double kEven = 0.15;
  double mean_index = 0.0;
  double mean_time = 0.0;
  const auto n = static_cast<double>(times.size());
  for (const auto& [frame, time] : times) {
    mean_index += ToInt(frame) / n;
    mean_time += time / n;
  }
  double xx = 0.0;
  double xy = 0.0;
  for (const auto& [frame, time] : times) {
    const double x = ToInt(frame) - mean_index;
    xx += x * x;
    xy += x * (time - mean_time);
  }
  return std::ranges::all_of(times, [&](const auto& entry) {
    const double on_line = mean_time + xy / xx * (ToInt(entry.first) - mean_index);
    return std::abs(entry.second - on_line) <= kEven;
  });
}

// Median distance that the tracks move from one frame to the other [px]; nullopt if they share too
// few, or hardly move.
std::optional<double> MotionPx(const TrackSet& tracks, FrameIndex from, FrameIndex to) {
  constexpr std::size_t kEnough = 8;
  constexpr double kLeastPx = 0.3;
  std::vector<double> motions = tracks.MotionsPx(from, to);
  if (motions.size() < kEnough) return std::nullopt;
  const double motion = Median(std::move(motions));
  if (motion < kLeastPx) return std::nullopt;
  return motion;
}

// Whether the tracks move equally far per picture rather than per time shown.
bool MoveEvenlyByPicture(const TrackFile& file, const FrameTimes& shown) {
  constexpr double kSameStep = 0.1;  // of the logarithm
  std::vector<double> by_picture;
  std::vector<double> by_time;
  std::optional<double> motion_before;
  double step_before = 0.0;
  for (std::size_t i = 1; i < file.frames.size(); ++i) {
    const FrameIndex from = file.frames[i - 1].index;
    const FrameIndex to = file.frames[i].index;
    const double step = std::log(shown.at(to) - shown.at(from));
    const auto motion = MotionPx(file.tracks, from, to);
    if (motion && motion_before && std::abs(step - step_before) > kSameStep) {
      const double change = std::log(*motion / *motion_before);
      by_picture.push_back(std::abs(change));
      by_time.push_back(std::abs(change - (step - step_before)));
    }
    motion_before = motion;
    step_before = step;
  }
  return Median(std::move(by_picture)) <= Median(std::move(by_time));
}

// The pictures in equal steps; time that passes beyond the frames shown is added.
FrameTimes EvenByPicture(const TrackFile& file, const FrameTimes& shown) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < file.frames.size(); ++i) {
    steps.push_back(IndexStep(file.frames[i - 1].index, file.frames[i].index));
  }
  double mean = 0.0;
  for (const double step : steps) mean += step / static_cast<double>(steps.size());
  FrameTimes times;
  double time = 0.0;
  times[file.frames.front().index] = time;
  for (std::size_t i = 1; i < file.frames.size(); ++i) {
    const FrameIndex from = file.frames[i - 1].index;
    const FrameIndex to = file.frames[i].index;
    const double missed = shown.at(to) - shown.at(from) - steps[i - 1];
    constexpr double kMissed = 0.5;  // less is jitter
    time += 1.0 + (missed > kMissed ? missed / mean : 0.0);
    times[to] = time;
  }
  return times;
}

}  // namespace

FrameTimes CaptureTimes(const TrackFile& file) {
  if (file.frames.size() < 3) return {};
  std::optional<FrameTimes> times = TimesOfStamps(AllShown(file));
  if (!file.repeats.empty()) {
    if (!times) {
      times.emplace();
      for (const Shown& frame : AllShown(file)) (*times)[frame.index] = ToInt(frame.index);
    }
    if (MoveEvenlyByPicture(file, *times)) return EvenByPicture(file, *times);
    for (const RepeatedFrame& repeat : file.repeats) times->erase(repeat.frame.index);
  }
  if (!times || AreEven(*times)) return {};
  return *times;
}

double TimeOf(const FrameTimes& times, FrameIndex frame) {
  const auto time = times.find(frame);
  return time != times.end() ? time->second : ToInt(frame);
}

}  // namespace cohort
