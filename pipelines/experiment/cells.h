#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/degrade/degrade.h"
#include "frontend/core/options.h"
#include "frontend/track/tracker_options.h"
#include "pipelines/sfm/input.h"
#include "pipelines/sfm/second_pass.h"

namespace cohort {

// A clip on disk; its ground truth, if any, is beside it.
struct GridClip {
  std::string input;
  std::string name;
  std::string fingerprint;  // of its files: changes when they do
  bool has_poses = false;
  bool has_track_truth = false;
  // Its files' focal length, as --camera-prior takes it; empty if there is none.
  std::string camera_prior;
};

inline constexpr std::string_view kAsIs = "as-is";

// Levels of the grid that use another recipe than the paper's.
struct RecipeLevel {
  std::string_view name;
  DegradeRecipe recipe;
  const char* level;
  double light = 1.0;  // DegradeOptions::light
};
inline constexpr std::array<RecipeLevel, 7> kRecipeLevels{
    {{"sensor", DegradeRecipe::kSensor, "hard"},
     {"sensor-half", DegradeRecipe::kSensor, "hard", 1.0 / 2},
     {"sensor-4th", DegradeRecipe::kSensor, "hard", 1.0 / 4},
     {"sensor-8th", DegradeRecipe::kSensor, "hard", 1.0 / 8},
     {"sensor-16th", DegradeRecipe::kSensor, "hard", 1.0 / 16},
     {"phone", DegradeRecipe::kPhone, "hard"},
     {"phone-medium", DegradeRecipe::kPhone, "medium"}}};

// Null if `level` is one of recipe paper, or as-is.
inline const RecipeLevel* FindRecipeLevel(std::string_view level) {
  const auto found = std::find_if(kRecipeLevels.begin(),
                                  kRecipeLevels.end(),
                                  [&](const RecipeLevel& r) { return r.name == level; });
  return found == kRecipeLevels.end() ? nullptr : &*found;
}

// One clip, level and seed, with all its files in one folder.
struct Condition {
  GridClip clip;
  std::string level;
  unsigned seed = 0;
  std::filesystem::path folder;

  bool IsDegraded() const { return level != kAsIs; }
  DegradeRecipe Recipe() const {
    const RecipeLevel* const other = FindRecipeLevel(level);
    return other != nullptr ? other->recipe : DegradeRecipe::kPaper;
  }
  std::string DegradeLevel() const {  // of the recipe
    const RecipeLevel* const other = FindRecipeLevel(level);
    return other != nullptr ? other->level : level;
  }
  double Light() const {
    const RecipeLevel* const other = FindRecipeLevel(level);
    return other != nullptr ? other->light : 1.0;
  }
  std::filesystem::path Frames() const {
    return IsDegraded() ? folder / "frames" : std::filesystem::path(clip.input);
  }
};

enum class TrackSource {
  kTracker,  // of `cohort track`
  kCeiling,  // the truth with the least noise of a patch; ceiling.h
  kSift,     // no tracks: COLMAP's own features; backend/colmap/sift_mapper.h
};

struct GridTracker {
  std::string name;  // in the tables
  TrackSource source = TrackSource::kTracker;
  TrackerOptions options;
  SecondPassMode second_pass = SecondPassMode::kAuto;
};

enum class GridBackend {
  kCeres,
  kColmap,
  kTriangulation,  // points alone, from the true cameras: isolates the tracks
};
inline constexpr ChoiceNames<GridBackend, 3> kGridBackendNames{
    {{"ceres", GridBackend::kCeres},
     {"colmap", GridBackend::kColmap},
     {"triangulation", GridBackend::kTriangulation}}};

struct TrackCell {
  Condition condition;
  GridTracker tracker;
  InputOptions frames;  // what the tracker reads
  std::filesystem::path folder;
  // The results of this grid, not of an earlier one; set by CollectResults.
  bool is_tracked = false;
  std::vector<GridBackend> modelled = {};

  bool IsModelled(GridBackend backend) const {
    return std::ranges::find(modelled, backend) != modelled.end();
  }
  std::filesystem::path Tracks() const { return folder / "clip.tracks"; }
  std::filesystem::path TrackErrors() const { return folder / "track_errors.json"; }
  std::filesystem::path Result() const { return folder / "tracks.json"; }
  std::filesystem::path Model(GridBackend backend) const {
    return folder / NameOf(kGridBackendNames, backend);
  }
  std::filesystem::path Result(GridBackend backend) const {
    return folder / (std::string(NameOf(kGridBackendNames, backend)) + ".json");
  }
  std::filesystem::path Halves(GridBackend backend) const {
    return folder / (std::string(NameOf(kGridBackendNames, backend)) + "_halves");
  }
  std::filesystem::path HalvesResult(GridBackend backend) const {
    return Halves(backend).string() + ".json";
  }
  bool Has(GridBackend backend) const {  // COLMAP's own features need COLMAP
    return tracker.source != TrackSource::kSift || backend == GridBackend::kColmap;
  }
  // Whether the agreement of the tracks' halves evaluates the model, as a fallback without true
  // cameras.
  bool HasHalves(GridBackend backend) const {
    return !condition.clip.has_poses && tracker.source == TrackSource::kTracker &&
           backend != GridBackend::kTriangulation;
  }
};

}  // namespace cohort
