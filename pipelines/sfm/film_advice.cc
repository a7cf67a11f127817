#include "pipelines/sfm/film_advice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string_view>

#include "backend/geometry/triangulation.h"
#include "backend/judge/moving_share.h"
#include "backend/scene/phrasebook.h"
#include "frontend/core/statistics.h"
#include "pipelines/sfm/cuts.h"

namespace cohort {
namespace {

// Describes the three longest stretches of frames, and how many more there are.
std::string StretchesText(std::vector<Stretch> stretches) {
  constexpr std::size_t kMost = 3;
  const auto length = [](const Stretch& s) { return ToInt(s.last) - ToInt(s.first); };
  std::stable_sort(stretches.begin(), stretches.end(), [&](const Stretch& a, const Stretch& b) {
    return length(a) > length(b);
  });
  const std::size_t more = stretches.size() - std::min(kMost, stretches.size());
  stretches.resize(stretches.size() - more);
  std::sort(stretches.begin(), stretches.end(), [](const Stretch& a, const Stretch& b) {
    return a.first < b.first;
  });
  std::string text;
  for (const Stretch& s : stretches) {
    text += (text.empty() ? "" : ", ") + FramesText(s.first, s.last);
  }
  if (more > 0) text += fmt::format(" and {} more place{}", more, more == 1 ? "" : "s");
  return text;
}

// Runs of consecutive frames of the file for which `holds` is true.
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

// Pairs of consecutive frames for which less than `share` of the features observed in the first are
// observed in the second; adjacent pairs are joined.
std::vector<Stretch> Losses(const TrackFile& file, double share) {
  std::vector<Stretch> losses;
  for (std::size_t i = 1; i < file.frames.size(); ++i) {
    const FrameIndex frame = file.frames[i - 1].index;
    const FrameIndex next = file.frames[i].index;
    std::size_t observed = 0;
    std::size_t kept = 0;
    for (const Observation* o : file.tracks.InFrame(frame)) {
      if (!IsObserved(*o)) continue;
      ++observed;
      const Observation* other = file.tracks.Find(o->feature, next);
      if (other != nullptr && IsObserved(*other)) ++kept;
    }
    if (static_cast<double>(kept) >= share * static_cast<double>(observed)) continue;
    if (losses.empty() || losses.back().last != frame) losses.push_back({frame, {}});
    losses.back().last = next;
  }
  return losses;
}

double ObservedIn(const TrackFile& file, FrameIndex frame) {
  return static_cast<double>(file.tracks.CountObserved(frame));
}

double ObservedInMedian(const FilmedClip& clip) {
  std::vector<double> counts;
  for (const FrameInfo& frame : clip.file.frames) {
    if (!AnyHas(clip.asides, frame.index)) counts.push_back(ObservedIn(clip.file, frame.index));
  }
  return Median(std::move(counts));
}

std::optional<double> ParallaxDeg(const Reconstruction& model) {
  std::map<FrameIndex, Eigen::Vector3d> centers;
  for (const auto& [frame, cam_from_world] : model.cam_from_world) {
    centers[frame] = cam_from_world.Inverse().translation;
  }
  std::vector<double> angles;
  for (const auto& [feature, point] : model.points) {
    if (point.views.empty()) continue;
    const Eigen::Vector3d& first = centers.at(point.views.front().frame);
    double widest = 0.0;
    for (const PointView& view : point.views) {
      widest = std::max(widest, TriangulationAngle(point.in_world, first, centers.at(view.frame)));
    }
    angles.push_back(widest * 180.0 / std::numbers::pi);
  }
  if (angles.empty()) return std::nullopt;
  return Median(std::move(angles));
}

// Explains why there is no model and what to do about it.
std::string_view WhyNoModel(std::optional<MapperTermination> ending) {
  switch (ending.value_or(MapperTermination::kNoStart)) {
    case MapperTermination::kStaticCamera:
      return "The camera stood still: only a moving camera can measure how far away things are. "
             "Walk past what you film, or around it.";
    case MapperTermination::kPureRotation:
      return "The camera only turned on the spot, or a moving object filled the picture. A camera "
             "that only turns cannot measure how far away things are: walk sideways while you "
             "film, at least a tenth of the distance to what you film.";
    case MapperTermination::kNotRigid:
      return "The points that can be tracked do not move like one rigid scene: many of them move "
             "on their own, or lie on something that bends. Keep people, cars, leaves and water "
             "out of the picture, or cover them by --mask.";
    case MapperTermination::kWeakDepth:
      return "The camera moved too little, given how uncertain the points are. Walk further, "
             "sideways to what you film, in more light.";
    case MapperTermination::kTooFewTracks:
      return "Hardly any points can be tracked from frame to frame. Film textured surfaces, in "
             "more light, and move slowly.";
    case MapperTermination::kNoStart:
    case MapperTermination::kSuccess:
    case MapperTermination::kPartial:
      break;
  }
  return "No two positions of the camera could be found that show one rigid scene. Film something "
         "static and textured, and walk slowly past it or around it.";
}

void AdviseOnLight(const FilmedClip& clip,
                   const ClipMeasures& measures,
                   std::vector<std::string>& advice) {
  if (clip.brightness.empty()) return;
  // A street at night had 11 of 255; dark rendered clips, whose cameras had 45 times the error of
  // daylight, had 15 to 23; dim rooms and objects in front of a dark background had 34 and more.
  constexpr double kDark = 0.11;
  if (measures.brightness < kDark) {
    advice.push_back(
        fmt::format("The pictures are dark, {:.0f} of 255 on average. More light makes the model "
                    "more accurate than anything else.",
                    255.0 * measures.brightness));
  }
  constexpr double kBlack = 0.01;
  // Ratio between two frames. A phone's exposure steps, or a lamp that enters the picture, give up
  // to 1.22.
  constexpr double kJump = 1.5;
  // A scene that begins from black or a title card may fade in.
  constexpr std::size_t kFade = 15;
  const auto is_near_aside = [&](std::size_t i) {
    const std::size_t end = std::min(clip.file.frames.size(), i + kFade + 1);
    for (std::size_t j = i - std::min(i, kFade); j < end; ++j) {
      if (AnyHas(clip.asides, clip.file.frames[j].index)) return true;
    }
    return false;
  };
  const std::vector<Stretch> jumps = Runs(clip.file, [&](std::size_t i) {
    if (i == 0 || i >= clip.brightness.size() || is_near_aside(i)) return false;
    const double before = clip.brightness[i - 1] + kBlack;
    const double now = clip.brightness[i] + kBlack;
    return now > kJump * before || before > kJump * now;
  });
  // Ratio over the clip. Cameras that look around in constant light give up to 1.4; a change from
  // black to glare gives 35.
  constexpr double kChange = 4.0;
  if (!jumps.empty()) {
    advice.push_back(fmt::format(
        "The light changes abruptly at {}. Lock the exposure of the camera, and keep lamps on.",
        StretchesText(jumps)));
  } else if (measures.bright + kBlack > kChange * (measures.dark + kBlack)) {
    advice.push_back(
        fmt::format("The light changes from {:.0f} to {:.0f} of 255. Lock the exposure of the "
                    "camera, and film in constant light.",
                    255.0 * measures.dark,
                    255.0 * measures.bright));
  }
}

}  // namespace

ClipMeasures MeasureClip(const FilmedClip& clip) {
  ClipMeasures measures;
  measures.observed = ObservedInMedian(clip);
  measures.parallax_deg = ParallaxDeg(clip.model);
  measures.moving_share = MovingShare(clip.file, clip.model);
  std::vector<double> brightness;  // of the scene
  for (std::size_t i = 0; i < clip.file.frames.size() && i < clip.brightness.size(); ++i) {
    if (!AnyHas(clip.asides, clip.file.frames[i].index)) brightness.push_back(clip.brightness[i]);
  }
  measures.dark = Quantile(brightness, 0.1);
  measures.brightness = Quantile(brightness, 0.5);
  measures.bright = Quantile(brightness, 0.9);
  return measures;
}

// The thresholds separate clips of known kinds, for which `cohort sfm --features 400` wrote the
// figures in the comments (`clip` in summary.json): 17 pieces of real video and 27 rendered ones,
// of 30 to 120 frames.
std::vector<std::string> FilmAdvice(const FilmedClip& clip, const ClipMeasures& measures) {
  std::vector<std::string> advice;
  const TrackFile& file = clip.file;
  const auto is_aside = [&clip](FrameIndex frame) { return AnyHas(clip.asides, frame); };
  if (file.frames.size() < 3 && clip.model.cam_from_world.empty()) {
    advice.push_back(fmt::format(
        "The clip has {}: a model needs at least three, preferably many, from different positions.",
        file.frames.size() < 2 ? "one frame" : "two frames"));
  } else if (clip.model.cam_from_world.empty()) {
    advice.emplace_back(WhyNoModel(EndingOf(clip.termination)));
  }
  AdviseOnLight(clip, measures, advice);
  // Rendered objects with plain sides had 62 and 70, a change from black to glare 98; a night clip
  // with a good model had 127, the others 168 and more.
  const double few = std::min(100.0, 0.5 * static_cast<double>(clip.features_wanted));
  // The minimum was 0.62 (a drive, a headset at a low frame rate) in real clips that can be
  // tracked, and 0.09 where a light is switched on.
  constexpr double kFewTies = 0.5;
  std::vector<Stretch> lost = Losses(file, kFewTies);
  std::erase_if(lost, [&](const Stretch& s) {
    const bool is_cut = std::ranges::any_of(
        file.meta.cuts, [&](FrameIndex cut) { return s.first < cut && cut <= s.last; });
    return is_cut || is_aside(s.first) || is_aside(s.last);
  });
  // Where there was hardly anything to follow, no speed is to blame.
  std::vector<Stretch> bare;
  std::erase_if(lost, [&](const Stretch& s) {
    if (ObservedIn(file, s.first) >= few && ObservedIn(file, s.last) >= few) return false;
    bare.push_back(s);
    return true;
  });
  if (measures.observed < few) {
    advice.push_back(
        fmt::format("Only {:.0f} points per frame can be tracked. Get more texture into the "
                    "picture, and keep it sharp.",
                    measures.observed));
  } else if (!bare.empty()) {
    advice.push_back(
        fmt::format("At {} there is hardly anything to track: blank walls, sky, or blur. Keep "
                    "something textured in the picture there, such as furniture or a floor.",
                    StretchesText(bare)));
  }
  // Whole clips had 2.4 degrees and more (the least: a drive along a street, and a hand that turns
  // the camera). Pieces of them with 4 to 10 frames had 0.2 to 1.4 degrees; their models were off
  // by 2 to 60 % of their path.
  constexpr double kLittleParallaxDeg = 1.5;
  if (measures.parallax_deg && *measures.parallax_deg < kLittleParallaxDeg) {
    advice.push_back(fmt::format(
        "The camera hardly moved: it saw half of the points from directions at most {:.1f} degrees "
        "apart. Walk further, sideways to what you film; depths are reliable at ten degrees or "
        "more.",
        *measures.parallax_deg));
  }
  // Static scenes had up to 0.034 (the most: a kitchen, a box of tags), also in the dark and with
  // one small walking person; a box in a hand had 0.08 and 0.21, a cloth 0.14, moving boxes 0.26,
  // and a castle that is turned in front of a room 0.28. Motion that looks like a static object
  // elsewhere is not detected: a patch that moves uniformly beside the camera had 0.
  constexpr double kMuchMoves = 0.06;
  if (measures.moving_share && *measures.moving_share > kMuchMoves) {
    advice.push_back(
        fmt::format("Something moves in the picture: {:.0f} % of the observations. The model shows "
                    "either the rest or only the moving part. Keep people, cars, leaves and water "
                    "out, or cover by --mask what the model should not show.",
                    100.0 * *measures.moving_share));
  }
  if (!lost.empty()) {
    advice.push_back(
        fmt::format("At {} most points were lost: the camera moved too fast, or something covered "
                    "the view. Move more slowly there.",
                    StretchesText(lost)));
  }
  const std::vector<Stretch> without_pose = Runs(file, [&](std::size_t i) {
    const FrameIndex frame = file.frames[i].index;
    return !clip.model.cam_from_world.contains(frame) && !is_aside(frame) &&
           std::ranges::none_of(clip.other_parts, [frame](const Stretch& part) {
             return part.first <= frame && frame <= part.last;
           });
  });
  if (!clip.model.cam_from_world.empty() && !without_pose.empty()) {
    advice.push_back(
        fmt::format("The model does not cover {}: the picture there has too little in common with "
                    "the rest. Film that place again, slowly, and return to what was seen before.",
                    StretchesText(without_pose)));
  }
  std::vector<Stretch> parts = clip.other_parts;
  std::erase_if(parts,
                [&](const Stretch& part) { return is_aside(part.first) && is_aside(part.last); });
  if (!parts.empty()) {
    advice.push_back(
        fmt::format("Separate models of {} are in other_parts: nothing connects them to the rest. "
                    "Film the places between them slowly.",
                    StretchesText(parts)));
  }
  constexpr std::size_t kMostAdvice = 3;  // the likeliest causes; more is not read
  if (advice.size() > kMostAdvice) advice.resize(kMostAdvice);
  return advice;
}

std::vector<std::string> DescribeAsides(const FilmedClip& clip) {
  constexpr double kBlack = 0.02;  // of the intensities 0..1
  std::vector<std::string> sentences;
  for (const Aside& aside : clip.asides) {
    std::string& sentence = sentences.emplace_back(DescribeAside(aside));
    std::vector<double> light;
    for (std::size_t i = 0; i < clip.file.frames.size() && i < clip.brightness.size(); ++i) {
      if (aside.Has(clip.file.frames[i].index)) light.push_back(clip.brightness[i]);
    }
    if (aside.kind == AsideKind::kBlank && Median(std::move(light)) < kBlack) {
      const bool one = aside.first == aside.last;
      sentence =
          fmt::format("{} {} black", FramesText(aside.first, aside.last), one ? "is" : "are");
    }
    if (aside.kind == AsideKind::kOtherScene) {
      const bool has_model = std::ranges::any_of(clip.other_parts, [&](const Stretch& part) {
        return aside.Has(part.first) && aside.Has(part.last);
      });
      sentence +=
          fmt::format("{}: {} reconstructs it alone",
                      has_model ? ", whose model is in model/other_parts" : "",
                      FramesOption(clip.file, aside.first, FrameIndex{ToInt(aside.last) + 1}));
    }
  }
  return sentences;
}

}  // namespace cohort
