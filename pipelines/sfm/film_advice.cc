#include "pipelines/sfm/film_advice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <functional>

#include "frontend/core/statistics.h"
#include "frontend/tracks/companions.h"

namespace cohort {
namespace {

std::string FramesText(FrameIndex first, FrameIndex last) {
  return first == last ? fmt::format("frame {}", ToInt(first))
                       : fmt::format("frames {} to {}", ToInt(first), ToInt(last));
}

// Of the longest three stretches of frames for which `holds`, and how many more there are.
std::string StretchesText(std::vector<Stretch> stretches) {
  constexpr std::size_t kMost = 3;
  const auto length = [](const Stretch& s) { return ToInt(s.last) - ToInt(s.first); };
  std::stable_sort(stretches.begin(), stretches.end(), [&](const Stretch& a, const Stretch& b) {
    return length(a) > length(b);
  });
  const std::size_t more = stretches.size() - std::min(kMost, stretches.size());
  stretches.resize(stretches.size() - more);
  std::string text;
  for (const Stretch& s : stretches) {
    text += (text.empty() ? "" : ", ") + FramesText(s.first, s.last);
  }
  if (more > 0) text += fmt::format(" and {} more places", more);
  return text;
}

// Runs of consecutive frames of the file of which `holds` is true.
std::vector<Stretch> Runs(const TrackFile& file, const std::function<bool(std::size_t)>& holds) {
  std::vector<Stretch> runs;
  bool inside = false;
  for (std::size_t i = 0; i < file.frames.size(); ++i) {
    const bool now = holds(i);
    if (now && !inside) runs.push_back({file.frames[i].index, {}});
    if (now) runs.back().last = file.frames[i].index;
    inside = now;
  }
  return runs;
}

double ObservedInMedian(const TrackFile& file) {
  std::vector<double> counts;
  for (const FrameInfo& frame : file.frames) {
    const auto in_frame = file.tracks.InFrame(frame.index);
    counts.push_back(static_cast<double>(std::count_if(
        in_frame.begin(), in_frame.end(), [](const auto* o) { return IsObserved(*o); })));
  }
  return counts.empty() ? 0.0 : Median(std::move(counts));
}

}  // namespace

std::vector<std::string> FilmAdvice(const TrackFile& file,
                                    const Reconstruction& model,
                                    const std::vector<double>& brightness) {
  std::vector<std::string> advice;
  const std::vector<Stretch> without_pose = Runs(
      file, [&](std::size_t i) { return !model.cam_from_world.contains(file.frames[i].index); });
  if (!without_pose.empty()) {
    advice.push_back(fmt::format(
        "Nothing is known of {}: the picture there has too little in common with the rest. Film "
        "that place again, slowly, and come back to what was seen before.",
        StretchesText(without_pose)));
  }
  constexpr double kFewTies = 0.5;
  const std::vector<Stretch> lost = WeakStretches(file.tracks, kFewTies, 0);
  if (!lost.empty()) {
    advice.push_back(fmt::format(
        "At {} most points were lost: the camera moved too fast, or something covered the view. "
        "Move more slowly there.",
        StretchesText(lost)));
  }
  constexpr double kFew = 100.0;
  const double observed = ObservedInMedian(file);
  if (observed < kFew) {
    advice.push_back(fmt::format(
        "Only {:.0f} points can be followed in a frame. Have more in the picture that has texture, "
        "and keep it sharp.",
        observed));
  }
  if (!brightness.empty()) {
    constexpr double kDark = 0.08;
    const double middle = Median(brightness);
    if (middle < kDark) {
      advice.push_back(
          fmt::format("The pictures are dark, {:.0f} of 255 on average. More light makes the model "
                      "more accurate than anything else.",
                      255.0 * middle));
    }
    constexpr double kJump = 1.5;  // between two frames
    const std::vector<Stretch> jumps = Runs(file, [&](std::size_t i) {
      constexpr double kBlack = 0.01;
      if (i == 0 || i >= brightness.size()) return false;
      const double before = brightness[i - 1] + kBlack;
      const double now = brightness[i] + kBlack;
      return now > kJump * before || before > kJump * now;
    });
    if (!jumps.empty()) {
      advice.push_back(
          fmt::format("The light jumps at {}. Lock the exposure of the camera, and keep lamps on.",
                      StretchesText(jumps)));
    }
  }
  return advice;
}

}  // namespace cohort
