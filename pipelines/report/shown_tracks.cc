#include "pipelines/report/shown_tracks.h"

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>

#include "datasets/degrade/degrade.h"
#include "datasets/truth/track_truth.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/report/brightening.h"
#include "pipelines/report/track_picture.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// The darkest frame, except for the first ones, in which tracks have no past yet.
std::optional<Frame> DarkestFrame(Sequence& sequence) {
  constexpr int kSkipped = 10;
  std::optional<Frame> darkest;
  double least = 0.0;
  for (int i = 0; auto frame = sequence.Next(); ++i) {
    const double mean = cv::mean(frame->gray)[0];
    if (!darkest || i <= kSkipped || mean < least) {
      darkest = frame;
      darkest->gray = frame->gray.clone();
      least = mean;
    }
  }
  return darkest;
}

}  // namespace

std::vector<const TrackCell*> ShowcaseCells(const ExperimentResults& results) {
  const auto darkness = [](const Condition& condition) {
    if (!condition.IsDegraded()) return -1.0;
    if (condition.Recipe() == DegradeRecipe::kPaper) return ParseLevel(condition.level);
    // Brighter than the paper's levels. Each stop less light adds as much darkness as the step from
    // medium to hard.
    return 0.75 * (ParseLevel(condition.DegradeLevel()) - std::log2(condition.Light()));
  };
  const Condition* shown = nullptr;
  for (const TrackCell& cell : results.cells) {
    const bool is_there = cell.is_tracked || !cell.modelled.empty();
    if (!is_there) continue;
    const Condition& c = cell.condition;
    const auto rank = [&](const Condition& condition) {
      return std::pair(condition.clip.has_track_truth, darkness(condition));
    };
    if (shown == nullptr || rank(c) > rank(*shown)) shown = &c;
  }
  std::vector<const TrackCell*> cells;
  if (shown == nullptr) return cells;
  for (const TrackCell& cell : results.cells) {
    if (cell.condition.folder == shown->folder) cells.push_back(&cell);
  }
  return cells;
}

Json TrackPicturesToJson(const std::vector<const TrackCell*>& cells) {
  Json trackers = Json::array();
  const TrackCell& first = *cells.front();
  const auto sequence = OpenInput(first.frames);
  const auto truth = OpenTrackTruth(*sequence, first.frames.input);
  const auto frame = DarkestFrame(*sequence);
  if (!frame) return nullptr;
  const cv::Mat brightened = Brightened(frame->gray, IntensityRangeOf(frame->gray));
  for (const TrackCell* cell : cells) {
    if (!cell->is_tracked || !fs::exists(cell->Tracks())) continue;
    const TrackFile file = ReadTrackFile(cell->Tracks());
    const TrackPicture picture = DrawTracks(brightened, frame->index, file.tracks, truth.get());
    trackers.push_back({{"tracker", cell->tracker.name},
                        {"observed", picture.observed},
                        {"predicted", picture.predicted},
                        {"known", picture.known},
                        {"near", picture.near_truth},
                        {"far", picture.far},
                        {"width", picture.picture.cols},
                        {"height", picture.picture.rows},
                        {"src", JpegDataUri(picture.picture)}});
  }
  return {{"sequence", first.condition.clip.name},
          {"level", first.condition.level},
          {"seed", first.condition.seed},
          {"frame", ToInt(frame->index)},
          {"has_truth", truth != nullptr},
          {"trackers", trackers}};
}

}  // namespace cohort
